//! A map as one safetensors file.
//!
//! Tensors: `descriptors` (places, dim); optionally `positions` (places, axes) in float64 metres, and `names`, the UTF-8
//! names with a NUL after each. One metadata entry, `surefix`, holds the rest as JSON. Any safetensors reader can open it.

use std::collections::HashMap;
use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use half::f16;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype as FileDtype, Metadata, TensorInfo, TensorView};
use serde::{Deserialize, Serialize};

use super::{Map, Positions, Recipe};
use crate::distance::{Dtype, Metric, Values};
use crate::error::Error;

const FORMAT: &str = "surefix-map";
const VERSION: u64 = 1;
/// The one metadata entry: one, so that the same map gives the same bytes.
const ENTRY: &str = "surefix";

#[derive(Serialize, Deserialize)]
struct Header {
    format: String,
    version: u64,
    metric: Metric,
    descriptor: Recipe,
}

impl Map {
    /// Saves the map as one safetensors file that carries all that is needed to use it. The file is written beside its
    /// place and then renamed: there is never half a file, and an old one stays until the new one is whole.
    ///
    /// # Errors
    /// [`Error::Io`] where the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        let io = |source| Error::Io { path: path.to_owned(), action: "write the map", source };
        self.write_beside(path).map_err(io)
    }

    /// Opens a map that [`save`](Self::save) wrote: reads it whole into memory.
    ///
    /// # Errors
    /// [`Error::Io`] where the file cannot be read, [`Error::MapFile`] where it is not a map or a damaged one,
    /// [`Error::MapVersion`] where a newer version of the library wrote it.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let io = |source| Error::Io { path: path.to_owned(), action: "read the map", source };
        let bytes = fs::read(path).map_err(io)?;
        let unusable = |reason: String| Error::MapFile { path: path.to_owned(), reason };
        let (_, metadata) = SafeTensors::read_metadata(&bytes)
            .map_err(|e| unusable(format!("truncated, or not a safetensors file ({e})")))?;
        let header = read_header(&metadata).map_err(|refusal| match refusal {
            Refusal::Foreign(reason) => unusable(reason),
            Refusal::Newer(found) => Error::MapVersion { path: path.to_owned(), found, supported: VERSION },
        })?;
        let tensors = SafeTensors::deserialize(&bytes).map_err(|e| unusable(e.to_string()))?;
        build(&header, &tensors).map_err(|e| unusable(e.to_string()))
    }

    fn write_beside(&self, path: &Path) -> io::Result<()> {
        if path.file_name().is_none() {
            return Err(io::Error::other("expected a file name, got a folder"));
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut beside = tempfile::Builder::new();
        beside.prefix(".surefix-").suffix(".part");
        #[cfg(unix)]
        {
            // Readable by whom the umask says, as any file that a program makes.
            use std::os::unix::fs::PermissionsExt as _;
            beside.permissions(fs::Permissions::from_mode(0o666));
        }
        let file = beside.tempfile_in(folder)?;
        let mut out = BufWriter::with_capacity(1 << 20, file.as_file());
        self.write(&mut out)?;
        out.flush()?;
        drop(out);
        file.as_file().sync_all()?;
        file.persist(path)?;
        Ok(())
    }

    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        // From the strictest alignment to the loosest, as the format asks for.
        let mut tensors: Vec<(&str, FileDtype, Vec<usize>, Vec<u8>)> = Vec::new();
        if let Some(positions) = &self.positions {
            let bytes = positions.metres().iter().flat_map(|x| x.to_le_bytes()).collect();
            tensors.push(("positions", FileDtype::F64, vec![positions.len(), positions.axes()], bytes));
        }
        let names: Option<Vec<u8>> =
            self.names.as_ref().map(|names| names.iter().flat_map(|name| name.bytes().chain([0])).collect());

        let rows = self.rows.view();
        let mut infos = Vec::new();
        let mut end = 0;
        let mut announce = |name: &str, dtype, shape: Vec<usize>, bytes: usize| {
            infos.push((name.to_owned(), TensorInfo { dtype, shape, data_offsets: (end, end + bytes) }));
            end += bytes;
        };
        for (name, dtype, shape, bytes) in &tensors {
            announce(name, *dtype, shape.clone(), bytes.len());
        }
        announce("descriptors", file_dtype(rows.dtype()), vec![self.places, self.dim], rows.bytes().len());
        if let Some(names) = &names {
            announce("names", FileDtype::U8, vec![names.len()], names.len());
        }

        let header = Header {
            format: FORMAT.to_owned(),
            version: VERSION,
            metric: self.metric,
            descriptor: self.recipe,
        };
        let entry = HashMap::from([(ENTRY.to_owned(), serde_json::to_string(&header)?)]);
        let metadata = Metadata::new(Some(entry), infos).map_err(io::Error::other)?;
        let mut text = serde_json::to_vec(&metadata)?;
        text.resize(text.len().next_multiple_of(8), b' ');
        out.write_all(&(text.len() as u64).to_le_bytes())?;
        out.write_all(&text)?;
        for (_, _, _, bytes) in &tensors {
            out.write_all(bytes)?;
        }
        out.write_all(rows.bytes())?;
        out.write_all(names.as_deref().unwrap_or_default())
    }
}

/// Why a header is not one of a map that can be read here.
enum Refusal {
    Foreign(String),
    Newer(u64),
}

fn read_header(metadata: &Metadata) -> Result<Header, Refusal> {
    /// The part that every version has: a newer one may lack the rest.
    #[derive(Deserialize)]
    struct Version {
        format: String,
        version: u64,
    }
    let foreign = |reason: &str| Refusal::Foreign(format!("a safetensors file, but {reason}"));
    let text = metadata.metadata().as_ref().and_then(|entries| entries.get(ENTRY));
    let text = text.ok_or_else(|| foreign("without surefix's entry: some other program wrote it"))?;
    let Version { format, version } =
        serde_json::from_str(text).map_err(|e| foreign(&format!("its entry cannot be read ({e})")))?;
    if format != FORMAT {
        return Err(foreign(&format!("expected the format {FORMAT:?}, got {format:?}")));
    }
    if version > VERSION {
        return Err(Refusal::Newer(version));
    }
    serde_json::from_str(text).map_err(|e| foreign(&format!("its entry cannot be read ({e})")))
}

fn build(header: &Header, tensors: &SafeTensors<'_>) -> Result<Map, Error> {
    let shape = |what, expected: &str, tensor: &TensorView<'_>| Error::Shape {
        what,
        expected: expected.to_owned(),
        got: format!("{:?} {:?}", tensor.dtype(), tensor.shape()),
    };
    let missing = |_| Error::Shape {
        what: "descriptors",
        expected: "a tensor of that name".to_owned(),
        got: "none".to_owned(),
    };
    let rows = tensors.tensor("descriptors").map_err(missing)?;
    let &[_, dim] = rows.shape() else {
        return Err(shape("descriptors", "a tensor (places, dim)", &rows));
    };
    let expected = "a tensor of F32, F16, I8 or U8, as the descriptor's recipe has it";
    let values = read_values(&rows).ok_or_else(|| shape("descriptors", expected, &rows))?;
    if let Recipe::Sad(sad) = header.descriptor
        && (sad.dtype(), sad.dim(), Metric::Manhattan) != (values.dtype(), dim, header.metric)
    {
        return Err(shape("descriptors", expected, &rows));
    }
    let mut map = Map::assemble(values, dim, header.metric, header.descriptor)?;
    if let Ok(positions) = tensors.tensor("positions") {
        let (FileDtype::F64, &[_, axes]) = (positions.dtype(), positions.shape()) else {
            return Err(shape("positions", "a tensor of F64 (places, axes)", &positions));
        };
        let metres = positions.data().as_chunks().0.iter().map(|x| f64::from_le_bytes(*x)).collect();
        map = map.with_positions(Positions::new(metres, axes)?)?;
    }
    if let Ok(names) = tensors.tensor("names") {
        let text = std::str::from_utf8(names.data()).ok().filter(|_| names.dtype() == FileDtype::U8);
        let text = text.ok_or_else(|| shape("names", "UTF-8 text", &names))?;
        map = map.with_names(text.split_terminator('\0').map(str::to_owned).collect())?;
    }
    Ok(map)
}

fn file_dtype(dtype: Dtype) -> FileDtype {
    match dtype {
        Dtype::F32 => FileDtype::F32,
        Dtype::F16 => FileDtype::F16,
        Dtype::I8 => FileDtype::I8,
        Dtype::U8 => FileDtype::U8,
    }
}

fn read_values(tensor: &TensorView<'_>) -> Option<Values> {
    let data = tensor.data();
    match tensor.dtype() {
        FileDtype::F32 => {
            Some(Values::F32(data.as_chunks().0.iter().map(|x| f32::from_le_bytes(*x)).collect()))
        }
        FileDtype::F16 => {
            Some(Values::F16(data.as_chunks().0.iter().map(|x| f16::from_le_bytes(*x)).collect()))
        }
        FileDtype::I8 => Some(Values::I8(data.iter().map(|x| x.cast_signed()).collect())),
        FileDtype::U8 => Some(Values::U8(data.to_vec())),
        _ => None,
    }
}
