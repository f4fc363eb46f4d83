//! The footer of a Parquet file: schema, units and positions of the row groups.
//!
//! The writer of the crate `parquet` writes a footer only when the file is closed, and without a
//! footer a Parquet file is unreadable: a run that is killed would lose all rows. So this module
//! keeps the positions of the row groups and renders a footer for every write. (Arrow IPC streams
//! need no footer, but most tools that read results expect Parquet.)

use std::collections::BTreeMap;
use std::sync::Arc;

use ::parquet::basic::{LogicalType, Repetition, Type as Physical};
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::{
    FileMetaData, KeyValue, ParquetMetaData, ParquetMetaDataWriter, RowGroupMetaData,
};
use ::parquet::schema::types::{SchemaDescPtr, SchemaDescriptor, Type, TypePtr};

use super::{Column, ColumnKind, TIME};

/// Metadata key of the units: a JSON object from name to unit.
const UNITS: &str = "units";
/// Metadata key from which pandas reads the attributes of a table.
const PANDAS: &str = "PANDAS_ATTRS";
/// Version of the format in the footer.
const VERSION: i32 = 1;

/// The content of the footer, for any number of row groups.
#[derive(Debug)]
pub(super) struct Footer {
    pub(super) schema: SchemaDescPtr,
    metadata: Vec<KeyValue>,
    /// The row groups that all later footers contain.
    pub(super) groups: Vec<RowGroupMetaData>,
}

impl Footer {
    pub(super) fn new(columns: &[Column]) -> Result<Self, ParquetError> {
        let mut fields = vec![field(TIME, ColumnKind::Real, Repetition::REQUIRED)?];
        for column in columns {
            let repetition =
                if column.clocked { Repetition::OPTIONAL } else { Repetition::REQUIRED };
            fields.push(field(&column.name, column.kind, repetition)?);
        }
        let schema = Type::group_type_builder("results").with_fields(fields).build()?;
        let mut units = BTreeMap::from([(TIME, "s")]);
        units.extend(
            columns.iter().filter_map(|one| Some((one.name.as_str(), one.unit.as_deref()?))),
        );
        let json = |value: serde_json::Value| value.to_string();
        let metadata = vec![
            KeyValue::new(UNITS.to_owned(), json(serde_json::json!(units))),
            KeyValue::new(PANDAS.to_owned(), json(serde_json::json!({ UNITS: units }))),
        ];
        let schema = Arc::new(SchemaDescriptor::new(Arc::new(schema)));
        Ok(Self { schema, metadata, groups: Vec::new() })
    }

    /// Renders the footer with all row groups so far, and with `last` after these groups in this footer only.
    pub(super) fn render(
        &mut self,
        last: Option<RowGroupMetaData>,
    ) -> Result<Vec<u8>, ParquetError> {
        let count = self.groups.len();
        let mut groups = std::mem::take(&mut self.groups);
        groups.extend(last);
        let rows = groups.iter().map(RowGroupMetaData::num_rows).sum();
        let file = FileMetaData::new(
            VERSION,
            rows,
            Some(concat!("aso-ftc ", env!("CARGO_PKG_VERSION")).to_owned()),
            Some(self.metadata.clone()),
            self.schema.clone(),
            None,
        );
        let all = ParquetMetaData::new(file, groups);
        let mut bytes = Vec::new();
        let done = ParquetMetaDataWriter::new(&mut bytes, &all).finish();
        self.groups = all.into_builder().take_row_groups();
        self.groups.truncate(count);
        done.map(|()| bytes)
    }
}

/// Returns the schema of a column.
fn field(name: &str, kind: ColumnKind, repetition: Repetition) -> Result<TypePtr, ParquetError> {
    let (physical, logical) = match kind {
        ColumnKind::Real => (Physical::DOUBLE, None),
        ColumnKind::Integer => (Physical::INT32, None),
        ColumnKind::Long => (Physical::INT64, None),
        ColumnKind::Boolean => (Physical::BOOLEAN, None),
        ColumnKind::String => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
    };
    let built = Type::primitive_type_builder(name, physical)
        .with_repetition(repetition)
        .with_logical_type(logical)
        .build()?;
    Ok(Arc::new(built))
}

/// Returns the metadata that a row group, written at offset 0, has at `start`.
pub(super) fn at_offset(
    group: &RowGroupMetaData,
    start: u64,
) -> Result<RowGroupMetaData, ParquetError> {
    let start = i64::try_from(start).map_err(|error| ParquetError::General(error.to_string()))?;
    let columns = group.columns().iter().map(|column| {
        let dictionary = column.dictionary_page_offset().map(|offset| offset + start);
        let data = column.data_page_offset() + start;
        let builder = column.clone().into_builder();
        builder.set_data_page_offset(data).set_dictionary_page_offset(dictionary).build()
    });
    let columns = columns.collect::<Result<Vec<_>, _>>()?;
    // The writer has set the ordinal for a file with this row group only.
    RowGroupMetaData::builder(group.schema_descr_ptr())
        .set_num_rows(group.num_rows())
        .set_total_byte_size(group.total_byte_size())
        .set_column_metadata(columns)
        .set_file_offset(start)
        .build()
}

/// Returns the units in the footer, by name of the column; none if the file is of another program.
pub(crate) fn units(metadata: &FileMetaData) -> BTreeMap<String, String> {
    metadata
        .key_value_metadata()
        .into_iter()
        .flatten()
        .find(|entry| entry.key == UNITS)
        .and_then(|entry| serde_json::from_str(entry.value.as_deref()?).ok())
        .unwrap_or_default()
}
