//! Point Cloud Data files of the Point Cloud Library, version 0.7: ascii, binary and binary_compressed.
//!
//! `x`, `y`, `z` are kept, found by name, and the colours of clouds that have them. The format: <https://pointclouds.org/documentation/tutorials/pcd_file_format.html>.

use std::borrow::Cow;

use glam::{DVec3, Vec3};

use super::{
    MOST_POINTS,
    bytes::{Endian, Reader, Scalar},
    error::Problem,
    lzf,
};
use crate::placement::PointCloud;

struct Field {
    name: String,
    scalar: Scalar,
    count: usize,
}

impl Field {
    fn size(&self) -> usize {
        self.scalar.size() * self.count
    }
}

#[derive(Default)]
struct Header {
    fields: Vec<Field>,
    width: usize,
    height: usize,
    viewpoint: DVec3,
    data: String,
}

impl Header {
    /// Points in the file.
    fn count(&self) -> usize {
        self.width.saturating_mul(self.height)
    }

    /// Bytes of a point.
    fn record(&self) -> usize {
        self.fields.iter().map(Field::size).sum()
    }
}

pub(super) fn read(bytes: &[u8]) -> Result<PointCloud, Problem> {
    let mut reader = Reader::new(bytes);
    let header = header(&mut reader)?;
    let count = header.count();
    let axes = axes(&header.fields)?;
    let points = match body(&mut reader, &header)? {
        Some(body) => {
            let places = axes.map(|axis| body.place(&header, axis));
            gather(&body.bytes, &header.fields, axes, places, count)?
        }
        None => ascii(&mut reader, &header, count, axes)?,
    };
    let cloud = if header.height > 1 {
        PointCloud::organised(points, header.width)
    } else {
        PointCloud::unorganised(points)
    };
    Ok(cloud.seen_from(header.viewpoint))
}

/// The colours of the points, sRGB, in the order of the points; `None` without a field `rgba` or `rgb`, and in ascii files.
pub(super) fn colours(bytes: &[u8]) -> Result<Option<Vec<[u8; 4]>>, Problem> {
    let mut reader = Reader::new(bytes);
    let header = header(&mut reader)?;
    let count = header.count();
    let is_colour = |field: &Field| matches!(field.name.as_str(), "rgba" | "rgb") && field.size() == 4;
    let Some(at) = header.fields.iter().position(is_colour) else { return Ok(None) };
    let Some(body) = body(&mut reader, &header)? else { return Ok(None) };
    let (start, step) = body.place(&header, at);
    let colour = |index: usize| match body.bytes.get(start + index * step..) {
        // The bytes of 0x00RRGGBB, the lowest first.
        Some([blue, green, red, ..]) => Ok([*red, *green, *blue, 255]),
        _ => Err(Problem::at(format!("point {index}"), "missing")),
    };
    (0..count).map(colour).collect::<Result<_, _>>().map(Some)
}

/// The points as bytes: one record after the other, or one field after the other in compressed files.
struct Body<'a> {
    bytes: Cow<'a, [u8]>,
    by_field: bool,
}

impl Body<'_> {
    /// Where a field of the first point starts, and bytes from one point to the next.
    fn place(&self, header: &Header, field: usize) -> (usize, usize) {
        if self.by_field {
            (offset(&header.fields, field, header.count()), header.fields.get(field).map_or(0, Field::size))
        } else {
            (offset(&header.fields, field, 1), header.record())
        }
    }
}

/// What follows the header of a binary file; `None` for ascii.
fn body<'a>(reader: &mut Reader<'a>, header: &Header) -> Result<Option<Body<'a>>, Problem> {
    let expected = header.record().saturating_mul(header.count());
    match header.data.as_str() {
        "ascii" => Ok(None),
        "binary" => Ok(Some(Body { bytes: reader.take(expected)?.into(), by_field: false })),
        "binary_compressed" => {
            let packed = reader.scalar(Scalar::U32, Endian::Little)? as usize;
            let size = reader.scalar(Scalar::U32, Endian::Little)? as usize;
            if size != expected {
                let problem = format!(
                    "{size} bytes announced, {} points of {} bytes expected",
                    header.count(),
                    header.record()
                );
                return Err(Problem::at(format!("byte {}", reader.position() - 4), problem));
            }
            Ok(Some(Body { bytes: lzf::expand(reader.take(packed)?, size)?.into(), by_field: true }))
        }
        other => {
            let problem = format!("DATA {other}: ascii, binary or binary_compressed expected");
            Err(Problem::at(reader.here(), problem))
        }
    }
}

fn header(reader: &mut Reader<'_>) -> Result<Header, Problem> {
    let mut header = Header::default();
    let (mut names, mut sizes, mut types, mut counts) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut points = None;
    loop {
        let Some(line) = reader.line()? else {
            return Err(Problem::at(reader.here(), "the header has no DATA line: not a PCD file"));
        };
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split_whitespace();
        let Some(key) = words.next() else { continue };
        let values: Vec<&str> = words.collect();
        let number = || -> Result<usize, Problem> {
            values
                .first()
                .and_then(|word| word.parse().ok())
                .filter(|&number| number <= MOST_POINTS)
                .ok_or_else(|| Problem::at(reader.here(), format!("{key}: 0 to {MOST_POINTS} expected")))
        };
        match key {
            "VERSION" => {}
            "FIELDS" => names = values,
            "SIZE" => sizes = values,
            "TYPE" => types = values,
            "COUNT" => counts = values,
            "WIDTH" => header.width = number()?,
            "HEIGHT" => header.height = number()?,
            "POINTS" => points = Some(number()?),
            "VIEWPOINT" => {
                let read: Vec<f64> = values.iter().filter_map(|word| word.parse().ok()).collect();
                let [x, y, z, ..] = read.as_slice() else {
                    return Err(Problem::at(reader.here(), "VIEWPOINT: seven numbers expected"));
                };
                header.viewpoint = DVec3::new(*x, *y, *z);
            }
            "DATA" => {
                header.data = values.first().copied().unwrap_or_default().to_ascii_lowercase();
                break;
            }
            _ => return Err(Problem::at(reader.here(), format!("`{key}` is no PCD header: not a PCD file"))),
        }
    }
    if names.len() != sizes.len()
        || names.len() != types.len()
        || !matches!(counts.len(), n if n == 0 || n == names.len())
    {
        return Err(Problem::at(
            "header",
            "FIELDS, SIZE, TYPE and COUNT must have the same number of entries",
        ));
    }
    for (index, name) in names.iter().enumerate() {
        let (size, kind) =
            (sizes.get(index).copied().unwrap_or_default(), types.get(index).copied().unwrap_or_default());
        let scalar = scalar(kind, size)
            .ok_or_else(|| Problem::at("header", format!("field {name}: no type {kind} of {size} bytes")))?;
        let count =
            counts.get(index).map_or(Some(1), |word| word.parse().ok()).filter(|count| *count <= 4096);
        let count =
            count.ok_or_else(|| Problem::at("header", format!("field {name}: COUNT 0 to 4096 expected")))?;
        header.fields.push(Field { name: (*name).into(), scalar, count });
    }
    // WIDTH and HEIGHT came with version 0.5; older files have POINTS only.
    if header.height == 0 && header.width == 0 {
        (header.width, header.height) = (points.unwrap_or(0), 1);
    }
    let size = header.count();
    if points.is_some_and(|points| points != size) || size > MOST_POINTS {
        let problem = format!("{} × {} points do not agree with POINTS", header.width, header.height);
        return Err(Problem::at("header", problem));
    }
    Ok(header)
}

fn scalar(kind: &str, size: &str) -> Option<Scalar> {
    Some(match (kind, size) {
        ("I", "1") => Scalar::I8,
        ("I", "2") => Scalar::I16,
        ("I", "4") => Scalar::I32,
        ("I", "8") => Scalar::I64,
        ("U", "1") => Scalar::U8,
        ("U", "2") => Scalar::U16,
        ("U", "4") => Scalar::U32,
        ("U", "8") => Scalar::U64,
        ("F", "4") => Scalar::F32,
        ("F", "8") => Scalar::F64,
        _ => return None,
    })
}

/// Which fields are x, y and z.
fn axes(fields: &[Field]) -> Result<[usize; 3], Problem> {
    let find = |name: &str| {
        fields
            .iter()
            .position(|field| field.name == name && field.count == 1)
            .ok_or_else(|| Problem::at("header", format!("there is no field {name}: not a point cloud")))
    };
    Ok([find("x")?, find("y")?, find("z")?])
}

/// Bytes before a field when every field before it is stored `repeated` times.
fn offset(fields: &[Field], axis: usize, repeated: usize) -> usize {
    fields.iter().take(axis).map(Field::size).sum::<usize>().saturating_mul(repeated)
}

fn gather(
    body: &[u8],
    fields: &[Field],
    axes: [usize; 3],
    places: [(usize, usize); 3],
    count: usize,
) -> Result<Vec<Vec3>, Problem> {
    let scalars = axes.map(|axis| fields.get(axis).map_or(Scalar::F32, |field| field.scalar));
    let coordinate = |index: usize, axis: usize| -> Option<f64> {
        let (start, step) = *places.get(axis)?;
        scalars.get(axis)?.read(body.get(start + index * step..)?, Endian::Little)
    };
    (0..count)
        .map(|index| {
            let read =
                || Some(DVec3::new(coordinate(index, 0)?, coordinate(index, 1)?, coordinate(index, 2)?));
            read()
                .map(|point| point.as_vec3())
                .ok_or_else(|| Problem::at(format!("point {index}"), "missing"))
        })
        .collect()
}

fn ascii(
    reader: &mut Reader<'_>,
    header: &Header,
    count: usize,
    axes: [usize; 3],
) -> Result<Vec<Vec3>, Problem> {
    // A point takes at least a digit and a separator for each number.
    let words = header.fields.iter().map(|field| field.count).sum::<usize>();
    if count.saturating_mul(words) > reader.rest().len() / 2 + 1 {
        let problem =
            format!("{count} points announced, {} bytes left: the file is cut short", reader.rest().len());
        return Err(Problem::at(reader.here(), problem));
    }
    let columns = axes.map(|axis| header.fields.iter().take(axis).map(|field| field.count).sum::<usize>());
    let mut points = Vec::with_capacity(count);
    while points.len() < count {
        let Some(line) = reader.line()? else {
            let problem = format!("{} of {count} points: the file is cut short", points.len());
            return Err(Problem::at(reader.here(), problem));
        };
        if line.trim().is_empty() {
            continue;
        }
        points.push(
            super::point_of_line(line, columns).map_err(|problem| Problem::at(reader.here(), problem))?,
        );
    }
    Ok(points)
}
