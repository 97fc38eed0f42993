//! Which pixels of an image are its points.

use cfpose_vision::{FORMATS, Foreground, PointTable, ReadOptions, Threshold};
use image::{DynamicImage, GrayImage, ImageFormat, Luma, Rgba, RgbaImage};

fn read(bytes: &[u8], options: ReadOptions) -> Result<PointTable, String> {
    let format = FORMATS.iter().find(|format| format.name == "mask").unwrap();
    (format.read)(bytes, &options).map_err(|flaw| flaw.fault.to_string())
}

/// Return x and y of each point.
fn pixels(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<[f64; 2]> {
    let table = read(&encode(image, format), ReadOptions::default()).unwrap();
    assert_eq!(table.columns, ["x", "y"]);
    (0..table.points.len()).map(|k| [table.points.point(k)[0], table.points.point(k)[1]]).collect()
}

fn encode(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.into().write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

#[test]
fn a_mask_gives_the_pixels_that_its_border_is_not() {
    let inside = |x: u32, y: u32| (2..5).contains(&x) && (1..3).contains(&y);
    let expected: Vec<[f64; 2]> = (1..3).flat_map(|y| (2..5).map(move |x| [f64::from(x), f64::from(y)])).collect();
    let grey = |inner: u8, outer: u8| GrayImage::from_fn(8, 6, |x, y| Luma([if inside(x, y) { inner } else { outer }]));
    for (inner, outer) in [(255, 0), (0, 255), (128, 127), (127, 128)] {
        assert_eq!(pixels(grey(inner, outer), ImageFormat::Png), expected);
    }
    // Where opacity varies, it is the mask, whatever the colours.
    let opaque = RgbaImage::from_fn(8, 6, |x, y| Rgba([9, 9, 9, if inside(x, y) { 255 } else { 0 }]));
    assert_eq!(pixels(opaque, ImageFormat::Png), expected);
    let coloured = RgbaImage::from_fn(8, 6, |x, y| Rgba(if inside(x, y) { [255, 255, 0, 80] } else { [0, 0, 99, 80] }));
    assert_eq!(pixels(coloured, ImageFormat::Png), expected);
    // A block of JPEG is constant here, so its loss moves no pixel across the threshold.
    let block = GrayImage::from_fn(32, 24, |x, y| Luma([if x / 8 == 1 && y / 8 == 1 { 250 } else { 5 }]));
    let jpeg = pixels(block, ImageFormat::Jpeg);
    assert_eq!((jpeg.len(), jpeg[0], jpeg[63]), (64, [8.0, 8.0], [15.0, 15.0]));
}

#[test]
fn options_override_the_rule_of_masks() {
    let bytes = encode(GrayImage::from_fn(5, 4, |x, _| Luma([50 * x as u8])), ImageFormat::Png);
    let count = |options: ReadOptions| read(&bytes, options).map(|table| table.points.len());
    let default = ReadOptions::default();
    assert_eq!(count(ReadOptions { foreground: Foreground::Bright, ..default.clone() }).unwrap(), 8);
    assert_eq!(count(ReadOptions { foreground: Foreground::Dark, ..default.clone() }).unwrap(), 12);
    assert_eq!(
        count(ReadOptions { foreground: Foreground::Bright, threshold: Threshold::Grey(49), ..default.clone() })
            .unwrap(),
        16
    );
    assert_eq!(count(default.clone()).unwrap(), 8, "6 of the 14 pixels on the border are bright");
    let none =
        count(ReadOptions { foreground: Foreground::Bright, threshold: Threshold::Grey(255), ..default.clone() })
            .unwrap_err();
    let message = "no pixel is foreground, that is above grey 255; choose the other side with --foreground dark or another \
                   threshold with --threshold";
    assert_eq!(none, message);
}

#[test]
fn an_image_of_labels_is_read_as_one_and_says_so() {
    let label = |x: u32| [0, 1, 2, 7][(x as usize).min(3)];
    let bytes = encode(GrayImage::from_fn(5, 4, |x, _| Luma([label(x)])), ImageFormat::Png);
    let table = read(&bytes, ReadOptions::default()).unwrap();
    assert_eq!(table.points.len(), 16);
    assert_eq!(table.notes, ["read as labels 0 to 7: points are the pixels above 0; --threshold T splits elsewhere"]);
    let grey = |value: u8| ReadOptions {
        threshold: Threshold::Grey(value),
        foreground: Foreground::Bright,
        ..ReadOptions::default()
    };
    assert_eq!(read(&bytes, grey(1)).unwrap().points.len(), 12);
    let dark = ReadOptions { foreground: Foreground::Dark, ..ReadOptions::default() };
    assert_eq!(read(&bytes, dark).unwrap().points.len(), 4);
    // A photograph of dim grey values is none: its values are many.
    let dim = encode(GrayImage::from_fn(80, 4, |x, _| Luma([x as u8])), ImageFormat::Png);
    assert!(read(&dim, ReadOptions { foreground: Foreground::Bright, ..Default::default() }).is_err());
}

#[test]
fn otsu_separates_two_heaps_of_grey_values() {
    let image = GrayImage::from_fn(40, 40, |x, y| {
        Luma([if (10..30).contains(&x) && (10..30).contains(&y) { 90 + (x % 7) as u8 } else { 30 + (y % 9) as u8 }])
    });
    let otsu = ReadOptions { threshold: Threshold::Otsu, ..ReadOptions::default() };
    assert_eq!(read(&encode(image, ImageFormat::Png), otsu.clone()).unwrap().points.len(), 400);
    let flat = encode(GrayImage::from_pixel(4, 4, Luma([200])), ImageFormat::Png);
    let bright = ReadOptions { foreground: Foreground::Bright, ..otsu };
    assert_eq!(read(&flat, bright).unwrap().points.len(), 16, "one value has no threshold of its own");
}

#[test]
fn more_foreground_than_the_limit_is_refused_with_the_number_that_reads_it() {
    let bytes = encode(GrayImage::from_pixel(2100, 2100, Luma([255])), ImageFormat::Png);
    let bright = ReadOptions { foreground: Foreground::Bright, ..ReadOptions::default() };
    let message = "more than 4194304 points (4410000); give --max-points 4410000 or reduce the image";
    assert_eq!(read(&bytes, bright.clone()).unwrap_err(), message);
    assert_eq!(read(&bytes, ReadOptions { max_points: Some(4_410_000), ..bright }).unwrap().points.len(), 4_410_000);
}

#[test]
fn bytes_after_the_end_of_an_image_are_refused() {
    let image = GrayImage::from_fn(32, 24, |x, y| Luma([if x / 8 == 1 && y / 8 == 1 { 250 } else { 5 }]));
    for format in [ImageFormat::Png, ImageFormat::Jpeg] {
        let bytes = encode(image.clone(), format);
        assert_eq!(read(&bytes, ReadOptions::default()).unwrap().points.len(), 64);
        // A film behind a photograph, a second image, zeros, a single byte.
        for more in [b"\0\0\0\x18ftypmp42".to_vec(), bytes.clone(), vec![0; 16], vec![b'\n']] {
            let message = read(&[&bytes[..], &more].concat(), ReadOptions::default()).unwrap_err();
            let expected =
                format!("the image cannot be decoded: {} byte(s) follow its end; save it again as PNG", more.len());
            assert_eq!(message, expected, "{format:?}");
        }
    }
    // Rows that look like markers are no end: a JPEG of noise.
    let noise = GrayImage::from_fn(64, 64, |x, y| Luma([((x * 7919 + y * 104_729) % 251) as u8]));
    assert!(read(&encode(noise, ImageFormat::Jpeg), ReadOptions::default()).is_ok());
}
