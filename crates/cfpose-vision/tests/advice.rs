//! What a message advises works when it is followed: flags are parsed out of the message and given to the reader, other
//! advice is carried out on the bytes.

mod common;

use cfpose_vision::{Foreground, Invalid, ReadOptions, Threshold};
use common::{gzip, npy_f8, read_with, zip};
use image::{GrayImage, ImageFormat, Luma};

/// Give a flag of a message to options; false for a flag without a value, which names a choice of the user.
fn give(options: &mut ReadOptions, flag: &str, value: Option<&str>) -> bool {
    match (flag, value) {
        ("--columns", Some(value)) => options.columns = value.split(',').map(str::to_string).collect(),
        ("--weight-column", Some(value)) => options.weight_column = Some(value.to_string()),
        ("--max-points", Some(value)) => options.max_points = Some(value.parse().unwrap()),
        ("--max-points", None) => options.max_points = Some(1_000_000),
        ("--format", Some(value)) => options.format = Some(value.to_string()),
        ("--threshold", None) => options.threshold = Threshold::Otsu,
        ("--foreground", Some("dark")) => options.foreground = Foreground::Dark,
        ("--foreground", Some("bright")) => options.foreground = Foreground::Bright,
        ("--invalid", Some("refuse")) => options.invalid = Invalid::Refuse,
        _ => return false,
    }
    true
}

/// Return what a message advises: groups of flags, one group for each alternative.
fn flags_of(message: &str) -> Vec<Vec<(String, Option<String>)>> {
    let advice = message.rsplit_once("; ").map_or("", |(_, advice)| advice);
    let mut alternatives = Vec::new();
    for alternative in advice.split(" or ") {
        let words: Vec<&str> = alternative.split_whitespace().collect();
        let mut flags = Vec::new();
        for (k, word) in words.iter().enumerate().filter(|(_, word)| word.starts_with("--")) {
            let value = words.get(k + 1).filter(|next| !next.starts_with("--"));
            flags.push((word.to_string(), value.map(|value| value.trim_end_matches(',').to_string())));
        }
        if !flags.is_empty() {
            alternatives.push(flags);
        }
    }
    alternatives
}

fn png(image: GrayImage) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[test]
fn flags_that_a_message_names_make_the_file_readable() {
    let default = ReadOptions::default();
    let most = |most: usize| ReadOptions { max_points: Some(most), ..ReadOptions::default() };
    let bright = png(GrayImage::from_fn(9, 9, |x, _| Luma([128 + x as u8])));
    let dark = ReadOptions { foreground: Foreground::Dark, ..ReadOptions::default() };
    let big = png(GrayImage::from_pixel(2049, 2049, Luma([255])));
    let cases: Vec<(&str, Vec<u8>, ReadOptions)> = vec![
        ("a.xyz", b"1 2 3 4\n5 6 7 9\n".to_vec(), default.clone()),
        ("a.csv", b"p1,1,2,3\np2,5,6,7\n".to_vec(), default.clone()),
        ("a.csv", b"foo,bar\n1,2\n3,5\n".to_vec(), default.clone()),
        ("a.csv", b"lat,name,lon\n1,A,2\n3,B,5\n".to_vec(), default.clone()),
        ("a.csv", b"x,y,depth\n1,2,3\n3,5,6\n".to_vec(), default.clone()),
        ("a.csv", b"u,v,w\n1,2,3\n3,5,6\n".to_vec(), default.clone()),
        ("a.npy", npy_f8("(4, 4)", &(0..16).map(f64::from).collect::<Vec<f64>>()), default.clone()),
        ("a.csv", b"1,2\n3,4\n5,6\n".to_vec(), most(2)),
        ("a.png", bright.clone(), dark),
        ("a.png", big, ReadOptions { foreground: Foreground::Bright, ..ReadOptions::default() }),
    ];
    for (name, bytes, options) in cases {
        let message = read_with(name, &bytes, &options).unwrap_err();
        let alternatives = flags_of(&message);
        assert!(!alternatives.is_empty(), "no flag in: {message}");
        for flags in alternatives {
            let mut followed = options.clone();
            for (flag, value) in &flags {
                // A value that is a word of the sentence, not of the flag.
                let of_flag = value.as_deref().filter(|value| !["and", "makes", "splits"].contains(value));
                assert!(give(&mut followed, flag, of_flag) || give(&mut followed, flag, None), "{flag} in: {message}");
            }
            let result = read_with(name, &bytes, &followed);
            assert!(result.is_ok(), "{flags:?} of: {message}\ngives: {:?}", result.unwrap_err());
        }
    }
}

#[test]
fn other_advice_works_on_the_file() {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    type Fix = Box<dyn Fn(&[u8]) -> Vec<u8>>;
    let replace = |from: &'static str, to: &'static str| -> Fix {
        Box::new(move |bytes| text(bytes).replace(from, to).into_bytes())
    };
    let ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nend_header\n1 2\n3 4\n";
    let array = npy_f8("(2, 5)", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 0.0]);
    let bomb: String = "1 2\n3 4\n".repeat(1 << 20);
    let gunzip: Fix = Box::new(move |_| bomb.clone().into_bytes());
    let packed = gzip("1 2\n3 4\n".repeat(1 << 20).as_bytes());
    let zeros = [npy_f8("(800000,)", &[]), vec![0; 6_400_000]].concat();
    let cases: Vec<(&str, &str, Vec<u8>, &str, Fix)> = vec![
        ("a.csv", "a.csv", b"1,5;2\n2.5;3\n".to_vec(), "write decimals with a point", replace(",", ".")),
        ("a.csv", "a.csv", b"1,2\n3,nan\n4,5\n".to_vec(), "remove or repair this row", replace("3,nan\n", "")),
        ("a.csv", "a.csv", b"1,2\n3,,\n4,5\n".to_vec(), "fill it in or remove the row", replace("3,,", "3,1")),
        (
            "a.csv",
            "a.csv",
            b"1,2\nnote\n4,5\n".to_vec(),
            "give every row the same number of columns",
            replace("note\n", ""),
        ),
        ("a.csv", "a.csv", b"1,2\n4,see\n3,4\n".to_vec(), "a comment starts with #", replace("4,see", "#4,see")),
        ("a.csv", "a.csv", b"1\r2\n3\n".to_vec(), "save the file with one kind of line end", replace("\r", "\n")),
        ("a.obj", "a.obj", b"v 1 2 3\nV 4 5 6\n".to_vec(), "write keywords in lower case", replace("V", "v")),
        ("a.obj", "a.obj", b"v 1 2 3\nv 4 5 6 0\nv 7 8 9\n".to_vec(), "remove the vertex", replace("v 4 5 6 0\n", "")),
        (
            "a.obj",
            "a.obj",
            b"v 1 2 3 1 1\nv 4 5 6\n".to_vec(),
            "write x y z, x y z w or x y z and a colour",
            replace("3 1 1", "3 1"),
        ),
        (
            "a.ply",
            "a.ply",
            ply.replace("vertex 2", "vertex 1").into(),
            "write the number that the file holds",
            replace("vertex 1", "vertex 2"),
        ),
        (
            "a.ply",
            "a.ply",
            ply.replace("float x", "uchar x").replace("3 4", "300 4").into(),
            "with a type that can",
            replace("uchar", "float"),
        ),
        (
            "a.ply",
            "a.ply",
            ply.replace("ascii", "zip").into(),
            "write ascii, binary_little_endian or",
            replace("zip", "ascii"),
        ),
        (
            "a.npy",
            "a.npy",
            array,
            "save the transposed array",
            Box::new(|_| npy_f8("(5, 2)", &[1.0, 6.0, 2.0, 7.0, 3.0, 8.0, 4.0, 9.0, 5.0, 0.0])),
        ),
        (
            "a.npy",
            "a.npy",
            npy_f8("(2, 2, 2)", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]),
            "save array.reshape(-1, array.shape[-1])",
            Box::new(|_| npy_f8("(4, 2)", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0])),
        ),
        ("a.xyz.gz", "a.xyz", packed, "unpack it first (gunzip)", gunzip),
        (
            "a.npz",
            "a.npz",
            zip(&[("x.npy", zeros.clone()), ("y.npy", zeros.clone())], true),
            "save it with numpy.savez",
            Box::new(move |_| {
                let mut x = zeros.clone();
                *x.last_mut().unwrap() = 0x40;
                zip(&[("x.npy", x), ("y.npy", zeros.clone())], false)
            }),
        ),
        (
            "a.npz",
            "a.npz",
            zip(&[("a.npy", npy_f8("(2, 2)", &[1.0, 2.0, 3.0, 4.0])), ("b.npy", npy_f8("(2,)", &[1.0, 2.0]))], true),
            "or call it points",
            Box::new(|_| {
                zip(
                    &[("points.npy", npy_f8("(2, 2)", &[1.0, 2.0, 3.0, 4.0])), ("b.npy", npy_f8("(2,)", &[1.0, 2.0]))],
                    true,
                )
            }),
        ),
        (
            "a.csv",
            "a.csv",
            b"\xff\xfe1\0,\x002\0\n\0".to_vec(),
            "save the file as UTF-8",
            Box::new(|_| b"1,2\n3,4\n".to_vec()),
        ),
    ];
    for (name, better, bytes, advice, fix) in cases {
        let message = read_with(name, &bytes, &ReadOptions::default()).unwrap_err();
        assert!(message.contains(advice), "{name}: {message}\nin place of: {advice}");
        let result = read_with(better, fix(&bytes), &ReadOptions::default());
        assert!(result.is_ok(), "{message}\nfollowed, gives: {:?}", result.unwrap_err());
    }
}
