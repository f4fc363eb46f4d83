//! Results in memory, shared with Python without copies.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;
use std::sync::Arc;

use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::types::{Float64Type, Int32Type, Int64Type};
use arrow_array::{
    Array as _, ArrayRef, BooleanArray, Float64Array, Int32Array, Int64Array, LargeBinaryArray,
    LargeStringArray, RecordBatch, RecordBatchIterator, cast::AsArray as _,
};
use arrow_buffer::{Buffer, NullBuffer, OffsetBuffer, ScalarBuffer};
use arrow_schema::ffi::FFI_ArrowSchema;
use arrow_schema::{ArrowError, DataType, Field, Schema};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule, PyDict, PyList, PyTuple};
use pyo3::{IntoPyObjectExt as _, pyclass};
use results::{Column, ColumnKind, Columns, TIME, Values};
use slave::{from_hex, to_hex};

use crate::error;

/// The columns of a run.
#[pyclass(frozen, module = "aso_ftc._core")]
pub(crate) struct Table {
    batch: RecordBatch,
    columns: Vec<Column>,
}

impl Table {
    /// Takes over the memory of the columns. Removes `prefix` from their names, unless the rest would be `time`. The
    /// columns named in `binaries` (names with prefix) contain hexadecimal digits and become bytes.
    pub(crate) fn new(
        recorded: Columns,
        binaries: &HashSet<String>,
        prefix: Option<&str>,
    ) -> PyResult<Self> {
        let rows = recorded.time.len();
        let time = Column {
            name: TIME.to_owned(),
            kind: ColumnKind::Real,
            unit: Some("s".to_owned()),
            clocked: false,
        };
        let mut arrays = vec![reals(recorded.time, None)];
        let mut columns = vec![time];
        let mut present = recorded.present.into_iter();
        for (mut column, values) in recorded.columns {
            let is_binary = binaries.contains(&column.name);
            let short = prefix.and_then(|prefix| column.name.strip_prefix(prefix));
            let short = short.filter(|name| *name != TIME).map(str::to_owned);
            if let Some(name) = short {
                column.name = name;
            }
            let nulls = if column.clocked { present.next().map(NullBuffer::from) } else { None };
            let array = match values {
                Values::String(texts) if is_binary => bytes(&texts, nulls.as_ref()),
                values => array(values, nulls).map_err(failed)?,
            };
            arrays.push(array);
            columns.push(column);
        }
        debug_assert!(
            arrays.iter().all(|array| array.len() == rows),
            "columns of different lengths"
        );
        let fields: Vec<_> = columns.iter().zip(&arrays).map(field).collect();
        let batch = RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays).map_err(failed)?;
        Ok(Self { batch, columns })
    }

    fn position(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }

    /// Returns the names of the columns of bytes.
    fn binaries(&self) -> HashSet<String> {
        let schema = self.batch.schema();
        let bytes =
            schema.fields().iter().filter(|field| *field.data_type() == DataType::LargeBinary);
        bytes.map(|field| field.name().clone()).collect()
    }

    /// Returns the columns under the names of this table, with bytes as hexadecimal digits.
    fn recorded(&self) -> Columns {
        let arrays = self.batch.columns().iter().skip(1);
        let columns = self.columns.iter().skip(1).cloned();
        let clocked = columns.clone().zip(arrays.clone()).filter(|(column, _)| column.clocked);
        let validity = |array: &ArrayRef| (0..array.len()).map(|row| array.is_valid(row)).collect();
        let present = clocked.map(|(_, array)| validity(array)).collect();
        Columns {
            time: self.batch.column(0).as_primitive::<Float64Type>().values().to_vec(),
            columns: columns.zip(arrays.map(values)).collect(),
            present,
        }
    }
}

fn failed(error: ArrowError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

fn field((column, array): (&Column, &ArrayRef)) -> Field {
    let unit = column.unit.clone().map(|unit| ("unit".to_owned(), unit));
    Field::new(&column.name, array.data_type().clone(), column.clocked)
        .with_metadata(unit.into_iter().collect::<HashMap<_, _>>())
}

/// Returns an array with the memory of `values`; `NumPy` sees NaN for a null.
fn reals(mut values: Vec<f64>, nulls: Option<NullBuffer>) -> ArrayRef {
    for (value, present) in values.iter_mut().zip(nulls.iter().flatten()) {
        *value = if present { *value } else { f64::NAN };
    }
    Arc::new(Float64Array::new(ScalarBuffer::from(values), nulls))
}

/// Returns an array with the memory of `values`; Booleans become bits.
fn array(values: Values, nulls: Option<NullBuffer>) -> Result<ArrayRef, ArrowError> {
    Ok(match values {
        Values::Real(values) => reals(values, nulls),
        Values::Integer(values) => Arc::new(Int32Array::new(ScalarBuffer::from(values), nulls)),
        Values::Long(values) => Arc::new(Int64Array::new(ScalarBuffer::from(values), nulls)),
        Values::Boolean(values) => Arc::new(BooleanArray::new(values.into(), nulls)),
        Values::String(values) => {
            let offsets = OffsetBuffer::new(ScalarBuffer::from(values.offsets));
            Arc::new(LargeStringArray::try_new(offsets, Buffer::from_vec(values.bytes), nulls)?)
        }
    })
}

/// Decodes texts of hexadecimal digits; null for a null and for a text with other characters.
fn bytes(texts: &results::Texts, nulls: Option<&NullBuffer>) -> ArrayRef {
    let rows = texts.offsets.len().saturating_sub(1);
    let value = |row| match nulls {
        Some(nulls) if nulls.is_null(row) => None,
        _ => texts.get(row).and_then(from_hex),
    };
    Arc::new((0..rows).map(value).collect::<LargeBinaryArray>())
}

/// Returns the values of an array that [`array`] or [`bytes`] returned; any value for a null.
fn values(array: &ArrayRef) -> Values {
    match array.data_type() {
        DataType::Int32 => Values::Integer(array.as_primitive::<Int32Type>().values().to_vec()),
        DataType::Int64 => Values::Long(array.as_primitive::<Int64Type>().values().to_vec()),
        DataType::Boolean => Values::Boolean(array.as_boolean().values().iter().collect()),
        DataType::LargeUtf8 => {
            let texts = array.as_string::<i64>();
            let (offsets, bytes) = (texts.offsets().to_vec(), texts.values().to_vec());
            Values::String(results::Texts { offsets, bytes })
        }
        DataType::LargeBinary => {
            let mut texts = results::Texts::default();
            for bytes in array.as_binary::<i64>() {
                texts.bytes.extend(to_hex(bytes.unwrap_or(&[])).into_bytes());
                texts.offsets.push(i64::try_from(texts.bytes.len()).unwrap_or(i64::MAX));
            }
            Values::String(texts)
        }
        _ => Values::Real(array.as_primitive::<Float64Type>().values().to_vec()),
    }
}

/// Returns the integers of an array with nulls as floating-point numbers, NaN for a null; any other array unchanged.
fn with_gaps(array: &ArrayRef) -> ArrayRef {
    #[expect(clippy::cast_precision_loss, reason = "as in pandas")]
    let numbers = match values(array) {
        Values::Integer(values) => values.into_iter().map(f64::from).collect(),
        Values::Long(values) => values.into_iter().map(|value| value as f64).collect(),
        _ => return array.clone(),
    };
    reals(numbers, array.nulls().cloned())
}

#[pymethods]
impl Table {
    /// Names of the columns, `time` first.
    #[getter]
    fn names(&self) -> Vec<&str> {
        self.columns.iter().map(|column| column.name.as_str()).collect()
    }

    /// Units by name of the column; `None` for a column without unit.
    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let units = PyDict::new(py);
        for column in &self.columns {
            units.set_item(&column.name, &column.unit)?;
        }
        Ok(units)
    }

    fn __len__(&self) -> usize {
        self.batch.num_rows()
    }

    /// The numbers of a column for `numpy.asarray`; `None` for texts, bytes, Booleans and an unknown name. Integers
    /// with gaps become floating-point numbers with NaN, as in pandas.
    fn numbers(&self, name: &str) -> Option<Numbers> {
        let array = self.batch.column(self.position(name)?).clone();
        let is_number = array.data_type().is_primitive();
        let array = if array.null_count() > 0 { with_gaps(&array) } else { array };
        is_number.then_some(Numbers { array })
    }

    /// The values of a column as a list, with `None` in gaps; `None` for an unknown name.
    fn values<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyList>>> {
        let Some(position) = self.position(name) else { return Ok(None) };
        let column = self.batch.column(position);
        if column.null_count() > 0 || *column.data_type() == DataType::LargeBinary {
            let all = (0..self.batch.num_rows()).map(|row| self.value(py, name, row));
            return Ok(Some(PyList::new(py, all.collect::<PyResult<Vec<_>>>()?)?));
        }
        Ok(Some(match values(column) {
            Values::Real(list) => PyList::new(py, list)?,
            Values::Integer(list) => PyList::new(py, list)?,
            Values::Long(list) => PyList::new(py, list)?,
            Values::Boolean(list) => PyList::new(py, list)?,
            Values::String(list) => {
                let rows = list.offsets.len().saturating_sub(1);
                PyList::new(py, (0..rows).map(|row| list.get(row).unwrap_or("")))?
            }
        }))
    }

    /// The value of a column in a row; `None` for a clocked variable between its ticks. `ValueError` for an unknown
    /// name or row.
    fn value<'py>(&self, py: Python<'py>, name: &str, row: usize) -> PyResult<Bound<'py, PyAny>> {
        let position = self.position(name).ok_or_else(|| PyValueError::new_err(name.to_owned()))?;
        if row >= self.batch.num_rows() {
            return Err(PyValueError::new_err(format!("there is no row {row}")));
        }
        let one = self.batch.column(position).slice(row, 1);
        if one.is_null(0) {
            return Ok(py.None().into_bound(py));
        }
        if let Some(bytes) = one.as_binary_opt::<i64>() {
            return Ok(PyBytes::new(py, bytes.value(0)).into_any());
        }
        match values(&one) {
            Values::Real(list) => list[0].into_bound_py_any(py),
            Values::Integer(list) => list[0].into_bound_py_any(py),
            Values::Long(list) => list[0].into_bound_py_any(py),
            Values::Boolean(list) => list[0].into_bound_py_any(py),
            // Read by Arrow, because the offsets of a slice count from the start of the whole array.
            Values::String(_) => one.as_string::<i64>().value(0).into_bound_py_any(py),
        }
    }

    /// Writes a `.csv` or `.parquet` file.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let written = py.detach(|| self.recorded().write(&path));
        written.map_err(|error| error::results(&error).raise(py))
    }

    /// The columns as bytes, for pickle.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| postcard::to_stdvec(&(self.recorded(), self.binaries())));
        let bytes = bytes.map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(PyBytes::new(py, &bytes))
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        Ok((py.import("aso_ftc._core")?.getattr("table_from_bytes")?, (self.to_bytes(py)?,)))
    }

    /// The Arrow C stream interface.
    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // A producer may ignore the requested schema; the caller converts.
        let _ = requested_schema;
        let (batch, schema) = (self.batch.clone(), self.batch.schema());
        let reader = RecordBatchIterator::new([Ok(batch)], schema);
        let stream = FFI_ArrowArrayStream::new(Box::new(reader));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }

    /// The Arrow C schema interface.
    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        let schema = FFI_ArrowSchema::try_from(self.batch.schema().as_ref()).map_err(failed)?;
        PyCapsule::new_with_value(py, schema, c"arrow_schema")
    }
}

/// Returns the table from which [`Table::to_bytes`] returned `bytes`. `ValueError` for other bytes.
#[pyfunction]
pub(crate) fn table_from_bytes(bytes: &[u8]) -> PyResult<Table> {
    let recorded = postcard::from_bytes(bytes);
    let (recorded, binaries) =
        recorded.map_err(|error| PyValueError::new_err(error.to_string()))?;
    Table::new(recorded, &binaries, None)
}

/// The numbers of a column, in the memory of the results.
#[pyclass(frozen, module = "aso_ftc._core")]
pub(crate) struct Numbers {
    array: ArrayRef,
}

#[pymethods]
impl Numbers {
    fn __len__(&self) -> usize {
        self.array.len()
    }

    /// Address, length and type of the numbers. `NumPy` keeps this object alive as long as its array.
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let endian = if cfg!(target_endian = "little") { '<' } else { '>' };
        let array = &self.array;
        let (kind, address) = match array.data_type() {
            DataType::Int32 => ("i4", array.as_primitive::<Int32Type>().values().as_ptr().addr()),
            DataType::Int64 => ("i8", array.as_primitive::<Int64Type>().values().as_ptr().addr()),
            _ => ("f8", array.as_primitive::<Float64Type>().values().as_ptr().addr()),
        };
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("typestr", format!("{endian}{kind}"))?;
        interface.set_item("shape", PyTuple::new(py, [self.array.len()])?)?;
        let read_only = true;
        interface.set_item("data", (address, read_only))?;
        Ok(interface)
    }
}
