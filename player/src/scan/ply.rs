//! PLY files (Turk's polygon format): ascii and binary of both byte orders; `x`, `y`, `z` of the element `vertex`.
//!
//! Other elements and properties are stepped over without looking at their values: phones write colours that their
//! declared type cannot hold, which stricter readers refuse.

use glam::{DVec3, Vec3};

use super::{
    MOST_POINTS,
    bytes::{Endian, Reader, Scalar},
    error::Problem,
};
use crate::placement::PointCloud;

enum Property {
    Value(Scalar),
    List { count: Scalar, value: Scalar },
}

impl Property {
    /// Fewest bytes it takes in a binary file.
    fn least_size(&self) -> usize {
        match self {
            Self::Value(scalar) => scalar.size(),
            Self::List { count, .. } => count.size(),
        }
    }
}

struct Element {
    name: String,
    count: usize,
    properties: Vec<(String, Property)>,
}

pub(super) fn read(bytes: &[u8]) -> Result<PointCloud, Problem> {
    let mut reader = Reader::new(bytes);
    let (endian, elements) = header(&mut reader)?;
    for element in &elements {
        bound(element, endian, &reader)?;
        let points = match endian {
            None => ascii(&mut reader, element)?,
            Some(endian) => binary(&mut reader, element, endian)?,
        };
        if element.name == "vertex" {
            return Ok(PointCloud::unorganised(points));
        }
    }
    Err(Problem::at("header", "there is no element `vertex`: not a point cloud"))
}

/// Refuses a count that the bytes at hand cannot hold, before anything is allocated or looped over.
fn bound(element: &Element, endian: Option<Endian>, reader: &Reader<'_>) -> Result<(), Problem> {
    let least = match endian {
        None => 2 * element.properties.len(),
        Some(_) => element.properties.iter().map(|(_, property)| property.least_size()).sum(),
    };
    // The last line of an ascii file may have no end.
    if element.count.saturating_mul(least.max(1)) > reader.rest().len() + 1 {
        let problem = format!(
            "{} of element {} announced, {} bytes left: the file is cut short",
            element.count,
            element.name,
            reader.rest().len()
        );
        return Err(Problem::at("header", problem));
    }
    Ok(())
}

fn header(reader: &mut Reader<'_>) -> Result<(Option<Endian>, Vec<Element>), Problem> {
    if reader.line()?.map(str::trim) != Some("ply") {
        return Err(Problem::at("line 1", "`ply` expected: not a PLY file"));
    }
    let mut endian = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let Some(line) = reader.line()? else {
            return Err(Problem::at(reader.here(), "the header has no end_header: the file is cut short"));
        };
        let words: Vec<&str> = line.split_whitespace().collect();
        let here = reader.here();
        match words.as_slice() {
            [] | ["comment" | "obj_info", ..] => {}
            ["format", "ascii", _] => endian = Some(None),
            ["format", "binary_little_endian", _] => endian = Some(Some(Endian::Little)),
            ["format", "binary_big_endian", _] => endian = Some(Some(Endian::Big)),
            ["element", name, count] => {
                let count = count.parse().ok().filter(|count| *count <= MOST_POINTS).ok_or_else(|| {
                    Problem::at(&here, format!("element {name}: a count of 0 to {MOST_POINTS} expected"))
                })?;
                elements.push(Element { name: (*name).into(), count, properties: Vec::new() });
            }
            ["property", rest @ .., name] => {
                let property = match rest {
                    [kind] => scalar(kind).map(Property::Value),
                    ["list", count, value] => {
                        scalar(count).zip(scalar(value)).map(|(count, value)| Property::List { count, value })
                    }
                    _ => None,
                };
                let property = property
                    .ok_or_else(|| Problem::at(&here, format!("property {name}: no type that PLY has")))?;
                let element =
                    elements.last_mut().ok_or_else(|| Problem::at(&here, "a property before any element"))?;
                element.properties.push(((*name).into(), property));
            }
            ["end_header"] => break,
            _ => return Err(Problem::at(here, "no PLY header line: the file is damaged")),
        }
    }
    let endian = endian.ok_or_else(|| {
        Problem::at("header", "format ascii, binary_little_endian or binary_big_endian expected")
    })?;
    Ok((endian, elements))
}

fn scalar(name: &str) -> Option<Scalar> {
    Some(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}

/// Which properties are x, y and z.
fn axes(element: &Element) -> Result<[usize; 3], Problem> {
    let find = |axis: &str| {
        element
            .properties
            .iter()
            .position(|(name, property)| name == axis && matches!(property, Property::Value(_)))
            .ok_or_else(|| Problem::at("header", format!("element vertex has no {axis}: not a point cloud")))
    };
    Ok([find("x")?, find("y")?, find("z")?])
}

fn ascii(reader: &mut Reader<'_>, element: &Element) -> Result<Vec<Vec3>, Problem> {
    let mut points = Vec::new();
    let is_vertex = element.name == "vertex";
    let columns = if is_vertex { axes(element)? } else { [0; 3] };
    let lists_first =
        element.properties.iter().any(|(_, property)| matches!(property, Property::List { .. }));
    if is_vertex && lists_first {
        return Err(Problem::at(
            "header",
            "lists in element vertex are not read: write the points without them",
        ));
    }
    for index in 0..element.count {
        let Some(line) = reader.line()? else {
            let problem = format!("{index} of {} {}: the file is cut short", element.count, element.name);
            return Err(Problem::at(reader.here(), problem));
        };
        if is_vertex {
            points.push(
                super::point_of_line(line, columns).map_err(|problem| Problem::at(reader.here(), problem))?,
            );
        }
    }
    Ok(points)
}

fn binary(reader: &mut Reader<'_>, element: &Element, endian: Endian) -> Result<Vec<Vec3>, Problem> {
    let is_vertex = element.name == "vertex";
    let axes = if is_vertex { axes(element)? } else { [usize::MAX; 3] };
    let mut points = Vec::new();
    for _ in 0..element.count {
        let mut point = [0.0; 3];
        for (index, (_, property)) in element.properties.iter().enumerate() {
            match property {
                Property::Value(scalar) => {
                    let value = reader.scalar(*scalar, endian)?;
                    for (axis, slot) in axes.iter().zip(&mut point) {
                        if *axis == index {
                            *slot = value;
                        }
                    }
                }
                Property::List { count, value } => {
                    let count = reader.scalar(*count, endian)?.max(0.0) as usize;
                    reader.take(count.saturating_mul(value.size()))?;
                }
            }
        }
        if is_vertex {
            points.push(DVec3::from_array(point).as_vec3());
        }
    }
    Ok(points)
}
