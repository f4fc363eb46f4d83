//! A model with a parameter and an output of every type that FMI 3.0 has and FMI 2.0 has not.
#![forbid(unsafe_code)]

use fmu::{Failure, Model, Step, Variables};

/// Outputs that equal parameters.
#[derive(Clone, Variables, serde::Serialize, serde::Deserialize)]
struct Types {
    /// Half of `single_out`
    #[fmu(input, min = -2, max = 2, start = 0.5)]
    single: f32,
    /// Twice `single`
    #[fmu(output, depends(single))]
    single_out: f32,
    /// 8 bits with a sign
    #[fmu(parameter, min = -5, start = -4)]
    int8: i8,
    /// A copy
    #[fmu(output, depends())]
    int8_out: i8,
    /// 8 bits
    #[fmu(parameter, start = 200)]
    uint8: u8,
    /// A copy
    #[fmu(output, depends())]
    uint8_out: u8,
    /// 16 bits with a sign
    #[fmu(parameter, start = -30000)]
    int16: i16,
    /// A copy
    #[fmu(output, depends())]
    int16_out: i16,
    /// 16 bits
    #[fmu(parameter, start = 60000)]
    uint16: u16,
    /// A copy
    #[fmu(output, depends())]
    uint16_out: u16,
    /// 32 bits
    #[fmu(parameter, start = 4_000_000_000)]
    uint32: u32,
    /// A copy
    #[fmu(output, depends())]
    uint32_out: u32,
    /// 64 bits with a sign, beyond the integers of a double
    #[fmu(parameter, start = -9_007_199_254_740_993)]
    int64: i64,
    /// A copy
    #[fmu(output, depends())]
    int64_out: i64,
    /// 64 bits
    #[fmu(parameter, start = u64::MAX)]
    uint64: u64,
    /// A copy
    #[fmu(output, depends())]
    uint64_out: u64,
    /// Bytes
    #[fmu(parameter, start = [0_u8, 255])]
    bytes: Vec<u8>,
    /// A copy
    #[fmu(output, depends())]
    bytes_out: Vec<u8>,
    /// An array
    #[fmu(parameter, start = [1, 2, 3])]
    row: [u16; 3],
    /// A copy
    #[fmu(output, depends())]
    row_out: [u16; 3],
}

#[fmu::model(stop_time = 1)]
impl Model for Types {
    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        self.single_out = 2.0 * self.single;
        self.int8_out = self.int8;
        self.uint8_out = self.uint8;
        self.int16_out = self.int16;
        self.uint16_out = self.uint16;
        self.uint32_out = self.uint32;
        self.int64_out = self.int64;
        self.uint64_out = self.uint64;
        self.bytes_out.clone_from(&self.bytes);
        self.row_out = self.row;
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        self.update(step.end())
    }
}

fmu::export!(Types);
