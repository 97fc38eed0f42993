//! What each format may look like: files made by other crates, by hand and by our own writers.

use std::path::Path;

use cfpose::Points;
use cfpose_vision::{FORMATS, PointTable, ReadOptions, read_points, write_points};
use npyz::{AutoSerialize, Serialize, WriterBuilder};
use ply_rs_bw::ply::{
    Addable, DefaultElement, ElementDef, Encoding, Ply, Property, PropertyDef, PropertyType, ScalarType,
};
use proptest::prelude::*;

fn read_as(extension: &str, bytes: &[u8]) -> PointTable {
    let format = FORMATS.iter().find(|format| format.extensions.contains(&extension)).unwrap();
    (format.read)(bytes, &ReadOptions::default()).unwrap_or_else(|flaw| panic!("{}{}", flaw.at, flaw.fault))
}

fn rows(points: &Points) -> Vec<Vec<f64>> {
    (0..points.len()).map(|k| points.point(k)[..points.dim()].to_vec()).collect()
}

#[test]
fn text_in_all_its_spellings() {
    let expected = vec![vec![1.0, -2.5], vec![30.0, 0.04]];
    for text in [
        "1,-2.5\n30,0.04\n",
        "1;-2.5\n30;0.04",
        "1\t-2.5\r\n30\t0.04\r\n",
        "  1   -2.5\n\n 3e1  4e-2  \n",
        "1 , -2.5\n30\t,\t.04\n",
        "\u{feff}x,y\n1,-2.5\n30,0.04\n",
        "\"u\";\"v\"\n1;-2.5\n30;0.04\n",
        "# made by hand\n+1.0e+000 -2.5 # first\n30. 4.0E-002\n",
        "1,-2.5,\n30,0.04,\n",
        "y,x,label\n-2.5,1,7\n0.04,30,8\n",
    ] {
        assert_eq!(rows(&read_as("txt", text.as_bytes()).points), expected, "{text:?}");
    }
    assert_eq!(rows(&read_as("csv", b"3\n1\n").points), [[3.0], [1.0]]);
    assert_eq!(rows(&read_as("xyz", b"1 2 3\n4 5 6\n").points), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
}

#[test]
fn a_column_w_is_a_weight_wherever_it_stands() {
    let expected = Points::weighted(vec![vec![1.0, 2.0], vec![3.0, 4.0]], vec![0.5, 0.0]).unwrap();
    let ply =
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float w\nproperty float y\nproperty int x\nend_header\n";
    for (extension, text) in [
        ("csv", "x,y,w\n1,3,.5\n2,4,0\n".to_string()),
        ("csv", "W;a;b\n.5;1;3\n0;2;4\n".to_string()),
        ("txt", "# x y w\n1 3 .5\n2 4 0\n".to_string()),
        ("ply", format!("{ply}.5 3 1\n0 4 2\n")),
        ("pcd", "FIELDS y w x\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nDATA ascii\n3 .5 1\n4 0 2\n".to_string()),
    ] {
        let table = read_as(extension, text.as_bytes());
        assert_eq!(table.points, expected, "{text}");
        assert!(table.columns[2].eq_ignore_ascii_case("w"));
    }
    // Without a header nothing says which column would be the weight.
    assert!(read_as("csv", b"1,3,.5\n2,4,0\n").points.is_uniform());
    assert!(read_as("csv", b"# a comment here\n1,3,.5\n2,4,0\n").points.is_uniform());
}

#[test]
fn obj_takes_vertices_and_nothing_else() {
    let text =
        "# v 9 9 9\nmtllib a.mtl\nv 1 2 3\nvn 0 0 1\nvt .5 .5\nv\t4 5 6 1.0\nf 1//1 2//1 1//1\nv 7 8 9 .1 .2 .3\n";
    assert_eq!(rows(&read_as("obj", text.as_bytes()).points), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]);
}

#[test]
fn every_writer_and_its_reader_agree_to_the_bit() {
    let awkward = [0.1, -0.0, 1e300, 5e-324, 1.0 / 3.0, -123_456_789.123_456_79];
    let column = |shift: usize| (0..6).map(|k| awkward[(k + shift) % 6]).collect::<Vec<f64>>();
    let folder = tempfile::tempdir().unwrap();
    for dim in 1..=3 {
        let columns: Vec<Vec<f64>> = (0..dim).map(column).collect();
        let uniform = Points::from_columns(columns.clone()).unwrap();
        let weighted = Points::weighted(columns, vec![1.0, 0.0, 0.25, 2.0, 1e-3, 7.0]).unwrap();
        for (points, refusing) in [(uniform, if dim == 3 { 0 } else { 1 }), (weighted, 2)] {
            let mut refused = 0;
            for extension in ["csv", "txt", "xyz", "ply", "obj", "pcd", "npy"] {
                let path = folder.path().join(format!("points.{extension}"));
                match write_points(&path, &points) {
                    Ok(()) => {
                        let read = read_points(&path, &ReadOptions::default()).unwrap().points;
                        assert_eq!(read, points, "{extension}");
                        let bits = |p: &Points| rows(p).concat().iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
                        assert_eq!(bits(&read), bits(&points), "{extension}");
                    }
                    Err(error) => {
                        refused += 1;
                        assert!(error.to_string().contains("; write csv"), "{error}");
                    }
                }
            }
            assert_eq!(refused, refusing, "formats that cannot hold dimension {dim}");
        }
    }
    let mask = write_points(Path::new("a.png"), &Points::from_rows(&[[1.0, 2.0]]).unwrap()).unwrap_err().to_string();
    assert_eq!(mask, "a.png: a mask file can be read and not written; write csv instead");
    let nowhere = write_points(Path::new("no/a.csv"), &Points::from_rows(&[[1.0, 2.0]]).unwrap()).unwrap_err();
    assert!(nowhere.to_string().starts_with("no/a.csv: "), "{nowhere}");
}

/// A number of every type that ply knows.
fn ply_property(kind: u8, value: i8) -> (ScalarType, Property) {
    let unsigned = value.unsigned_abs();
    match kind {
        0 => (ScalarType::Char, Property::Char(value)),
        1 => (ScalarType::UChar, Property::UChar(unsigned)),
        2 => (ScalarType::Short, Property::Short(i16::from(value) * 200)),
        3 => (ScalarType::UShort, Property::UShort(u16::from(unsigned) * 300)),
        4 => (ScalarType::Int, Property::Int(i32::from(value) * 1_000_000)),
        5 => (ScalarType::UInt, Property::UInt(u32::from(unsigned) * 30_000_000)),
        6 => (ScalarType::Float, Property::Float(f32::from(value) / 7.0)),
        _ => (ScalarType::Double, Property::Double(f64::from(value) / 7.0)),
    }
}

fn ply_value(property: &Property) -> f64 {
    match property {
        Property::Char(v) => f64::from(*v),
        Property::UChar(v) => f64::from(*v),
        Property::Short(v) => f64::from(*v),
        Property::UShort(v) => f64::from(*v),
        Property::Int(v) => f64::from(*v),
        Property::UInt(v) => f64::from(*v),
        Property::Float(v) => f64::from(*v),
        Property::Double(v) => *v,
        other => panic!("not a number: {other:?}"),
    }
}

/// Write a ply file with another crate: a face element first, then vertices with the axes and a list in some order.
fn foreign_ply(encoding: Encoding, order: &[usize], kinds: &[u8], values: &[[i8; 3]]) -> (Vec<u8>, Vec<Vec<f64>>) {
    let mut ply = Ply::<DefaultElement>::new();
    ply.header.encoding = encoding;
    let list = PropertyType::List(ScalarType::UChar, ScalarType::Int);
    let mut face = ElementDef::new("face".to_string());
    face.properties.add(PropertyDef::new("vertex_indices".to_string(), list.clone()));
    let mut vertex = ElementDef::new("vertex".to_string());
    for index in order {
        let (name, kind) = match index {
            3 => ("extra".to_string(), list.clone()),
            axis => (["x", "y", "z"][*axis].to_string(), PropertyType::Scalar(ply_property(kinds[*axis], 0).0)),
        };
        vertex.properties.add(PropertyDef::new(name, kind));
    }
    ply.header.elements.add(face);
    ply.header.elements.add(vertex);
    let mut one_face = DefaultElement::new();
    one_face.insert("vertex_indices".to_string(), Property::ListInt(vec![0, 1, 2]));
    ply.payload.insert("face".to_string(), vec![one_face]);
    let (mut elements, mut expected) = (Vec::new(), Vec::new());
    for (row, value) in values.iter().enumerate() {
        let mut element = DefaultElement::new();
        let properties: Vec<Property> = (0..3).map(|axis| ply_property(kinds[axis], value[axis]).1).collect();
        expected.push(properties.iter().map(ply_value).collect());
        for (name, property) in ["x", "y", "z"].into_iter().zip(properties) {
            element.insert(name.to_string(), property);
        }
        element.insert("extra".to_string(), Property::ListInt(vec![5; row % 4]));
        elements.push(element);
    }
    ply.payload.insert("vertex".to_string(), elements);
    let mut bytes = Vec::new();
    ply_rs_bw::writer::Writer::new().write_ply(&mut bytes, &mut ply).unwrap();
    (bytes, expected)
}

/// Write an npy file with another crate.
fn foreign_npy<T: AutoSerialize + Serialize + Clone>(values: &[T], dim: Option<usize>, fortran: bool) -> Vec<u8> {
    let rows = (values.len() / dim.unwrap_or(1)) as u64;
    let shape = dim.map_or(vec![rows], |dim| vec![rows, dim as u64]);
    let mut bytes = Vec::new();
    let order = if fortran { npyz::Order::Fortran } else { npyz::Order::C };
    let options = npyz::WriteOptions::new().default_dtype().shape(&shape).order(order).writer(&mut bytes);
    let mut writer = options.begin_nd().unwrap();
    writer.extend(values.iter().cloned()).unwrap();
    writer.finish().unwrap();
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn ply_of_another_crate_reads_alike(
        encoding in prop_oneof![
            Just(Encoding::Ascii), Just(Encoding::BinaryLittleEndian), Just(Encoding::BinaryBigEndian)
        ],
        order in Just(vec![0usize, 1, 2, 3]).prop_shuffle(),
        kinds in prop::array::uniform3(0u8..8),
        values in prop::collection::vec(prop::array::uniform3(any::<i8>()), 1..20),
    ) {
        let (bytes, expected) = foreign_ply(encoding, &order, &kinds, &values);
        let table = read_as("ply", &bytes);
        // Ascii holds a float32 in decimal: reading it as a double differs by its rounding.
        for (row, expected) in rows(&table.points).iter().zip(&expected) {
            for (value, expected) in row.iter().zip(expected) {
                let tolerance = if encoding == Encoding::Ascii { 1e-6 * expected.abs() } else { 0.0 };
                prop_assert!((value - expected).abs() <= tolerance);
            }
        }
        prop_assert_eq!(table.points.len(), values.len());
    }

    #[test]
    fn npy_of_another_crate_reads_alike(
        values in prop::collection::vec(any::<i8>(), 6..60),
        dim in 1usize..4,
        fortran: bool,
    ) {
        let values = &values[..values.len() / dim * dim];
        let n = values.len() / dim;
        let at = |k: usize, d: usize| f64::from(values[if fortran { d * n + k } else { k * dim + d }]);
        let expected: Vec<Vec<f64>> = (0..n).map(|k| (0..dim).map(|d| at(k, d)).collect()).collect();
        let wide: Vec<i64> = values.iter().map(|v| i64::from(*v)).collect();
        let single: Vec<f32> = values.iter().map(|v| f32::from(*v)).collect();
        let double: Vec<f64> = values.iter().map(|v| f64::from(*v)).collect();
        for bytes in [
            foreign_npy(values, Some(dim), fortran),
            foreign_npy(&wide, Some(dim), fortran),
            foreign_npy(&single, Some(dim), fortran),
            foreign_npy(&double, Some(dim), fortran),
        ] {
            prop_assert_eq!(&rows(&read_as("npy", &bytes).points), &expected);
        }
        let line = read_as("npy", &foreign_npy(&double, None, false)).points;
        prop_assert_eq!(line.column(0), &double[..]);
        let ours = Points::from_columns((0..dim).map(|d| (0..n).map(|k| at(k, d)).collect()).collect()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        write_points(&path, &ours).unwrap();
        let theirs = npyz::NpyFile::new(std::fs::File::open(&path).unwrap()).unwrap();
        prop_assert_eq!(theirs.shape(), &[n as u64, dim as u64]);
        prop_assert_eq!(theirs.into_vec::<f64>().unwrap(), expected.concat());
    }

    #[test]
    fn binary_and_compressed_pcd_read_like_ascii(
        values in prop::collection::vec(prop::array::uniform3(-9i8..9), 2..200),
    ) {
        let header = |data: &str| format!(
            "# .PCD v0.7\nVERSION 0.7\nFIELDS normal z _ y x\nSIZE 4 8 1 2 4\nTYPE F F U I F\nCOUNT 3 1 5 1 1\n\
             WIDTH {0}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {0}\nDATA {data}\n", values.len()
        );
        let (mut ascii, mut binary, mut fields) = (header("ascii"), Vec::new(), vec![Vec::new(); 5]);
        for [x, y, z] in &values {
            ascii += &format!("1 2 3 {z} 0 0 0 0 0 {y} {x}\n");
            let normal: Vec<u8> = [1f32, 2.0, 3.0].iter().flat_map(|v| v.to_le_bytes()).collect();
            let row = [
                normal,
                f64::from(*z).to_le_bytes().to_vec(),
                vec![0; 5],
                i16::from(*y).to_le_bytes().to_vec(),
                f32::from(*x).to_le_bytes().to_vec(),
            ];
            for (field, bytes) in fields.iter_mut().zip(&row) {
                field.extend_from_slice(bytes);
            }
            binary.extend(row.concat());
        }
        let columns = fields.concat();
        let packed = compress(&columns);
        prop_assert!(packed.len() < columns.len(), "the copies are exercised");
        let sizes = [(packed.len() as u32).to_le_bytes(), (columns.len() as u32).to_le_bytes()].concat();
        let expected: Vec<Vec<f64>> = values.iter().map(|v| v.iter().map(|v| f64::from(*v)).collect()).collect();
        let compressed = [header("binary_compressed").as_bytes(), &sizes, &packed].concat();
        for bytes in [ascii.into_bytes(), [header("binary").as_bytes(), &binary].concat(), compressed] {
            prop_assert_eq!(&rows(&read_as("pcd", &bytes).points), &expected);
        }
    }
}

/// Compress with LZF: the longest match within reach, else one literal.
fn compress(bytes: &[u8]) -> Vec<u8> {
    let (mut packed, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        let length =
            |start: usize| (0..264.min(bytes.len() - at)).take_while(|i| bytes[start + i] == bytes[at + i]).count();
        let best = (at.saturating_sub(64)..at).map(|start| (length(start), start)).max().unwrap_or((0, 0));
        if best.0 < 3 {
            packed.extend([0, bytes[at]]);
            at += 1;
            continue;
        }
        let (distance, length) = (at - best.1 - 1, best.0 - 2);
        if length < 7 {
            packed.push(((length << 5) | (distance >> 8)) as u8);
        } else {
            packed.extend([(7 << 5 | (distance >> 8)) as u8, (length - 7) as u8]);
        }
        packed.push((distance & 255) as u8);
        at += best.0;
    }
    packed
}
