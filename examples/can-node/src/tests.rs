use super::network::read;

/// The DBC text of one message with these signals.
fn network(signals: &str) -> String {
    format!("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: A B\n\nBO_ 500 M: 8 A\n{signals}\n")
}

fn error(signals: &str) -> String {
    read(&network(signals)).map(|_| ()).unwrap_err()
}

/// The bytes are those of the Python package cantools 45.1.
#[test]
fn bits_are_where_both_byte_orders_put_them() {
    let (_, messages) = read(&network(
        " SG_ intel : 4|12@1+ (1,0) [0|0] \"\" B\n SG_ motorola : 23|12@0+ (1,0) [0|0] \"\" B",
    ))
    .unwrap();
    let mut bytes = [0; 8];
    messages[0].signals[0].pack(f64::from(0xabc), &mut bytes);
    assert_eq!(bytes[..2], [0xc0, 0xab]);
    messages[0].signals[1].pack(f64::from(0xabc), &mut bytes);
    assert_eq!(bytes[..4], [0xc0, 0xab, 0xab, 0xc0]);
    for signal in &messages[0].signals {
        assert_eq!(signal.unpack(&bytes).to_bits(), f64::from(0xabc).to_bits());
    }
}

#[test]
fn values_are_rounded_to_the_factor_and_limited_to_the_bits() {
    let (_, messages) = read(&network(
        " SG_ signed : 0|8@1- (0.5,10) [0|0] \"\" B\n SG_ unsigned : 8|8@1+ (0.5,10) [0|0] \"\" B",
    ))
    .unwrap();
    let expected =
        [[(-1e9, -54.0), (3.2, 3.0), (1e9, 73.5)], [(-1e9, 10.0), (13.3, 13.5), (1e9, 137.5)]];
    for (signal, values) in messages[0].signals.iter().zip(expected) {
        for (value, expected) in values {
            let mut bytes = [0; 8];
            signal.pack(value, &mut bytes);
            assert_eq!(signal.unpack(&bytes).to_bits(), f64::to_bits(expected), "{value}");
        }
    }
}

#[test]
fn what_the_node_cannot_pack_is_refused_by_name() {
    assert!(error(" SG_ far : 60|8@1- (1,0) [0|0] \"\" B").contains("signal far: its bits"));
    assert!(
        error(" SG_ none : 0|8@1- (0,0) [0|0] \"\" B").contains("signal none: expected a finite")
    );
    assert!(error(" SG_ some m1 : 0|8@1- (1,0) [0|0] \"\" B").contains("multiplexed"));
    assert!(error("nonsense").contains("nonsense"), "{}", error("nonsense"));
}
