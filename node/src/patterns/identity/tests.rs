//! Strips written, shown on desktops of all kinds, and found again.

use protocol::pattern::Pattern;

use super::*;
use crate::patterns::{About, draw};

/// A desktop with something on every pixel that is no strip.
struct Desktop {
    width: usize,
    height: usize,
    bytes: Vec<u8>,
}

impl Desktop {
    fn new(width: usize, height: usize, paint: impl Fn(usize, usize) -> [u8; 3]) -> Self {
        let places = (0..width * height).map(|number| (number % width, number / width));
        let pixel = |(x, y)| {
            let [red, green, blue] = paint(x, y);
            [red, green, blue, 255]
        };
        Self {
            width,
            height,
            bytes: places.flat_map(pixel).collect(),
        }
    }

    /// Shows an identify page, each of its pixels as a square of so many pixels, as far as it is on the desktop.
    fn show(&mut self, at: [usize; 2], size_px: [u32; 2], output: &str, enlarged: usize) {
        let about = About {
            wall: "lab".into(),
            host: "left".into(),
            output: output.into(),
            size_px,
            ..About::default()
        };
        let page = draw(Pattern::Identify, &about);
        let [width, height] = size_px.map(|side| side as usize);
        for y in at[1]..self.height.min(at[1] + height * enlarged) {
            for x in at[0]..self.width.min(at[0] + width * enlarged) {
                let from = (y - at[1]) / enlarged * width + (x - at[0]) / enlarged;
                let to = y * self.width + x;
                self.bytes[4 * to..][..4].copy_from_slice(&page[4 * from..][..4]);
            }
        }
    }

    fn found(&self) -> Vec<FoundIdentity> {
        let found = read_identities(&self.bytes, self.width as u32, self.height as u32);
        let first = read_identity(&self.bytes, self.width as u32, self.height as u32);
        assert_eq!(first, found.first().map(|found| found.number));
        found
    }
}

fn noise(x: usize, y: usize) -> [u8; 3] {
    let mixed = ((x * 7919) ^ (y * 104_729)).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
    [mixed as u8, (mixed >> 8) as u8, (mixed >> 16) as u8]
}

#[test]
fn numbers_are_those_of_a_known_check_sum() {
    // The check value of CRC-32/ISO-HDLC is that of "123456789".
    assert_eq!(crc32fast::hash(b"123456789"), 0xcbf4_3926);
    assert_eq!(identity("1", "3", "5"), crc32fast::hash(b"1/3/5"));
    assert_ne!(identity("lab", "left", "a"), identity("lab", "left", "b"));
}

#[test]
fn a_strip_is_laid_out_as_it_is_described() {
    let number = 0x8000_0001_u32;
    let mut paper = Paper::new([612, 20]);
    assert_eq!(write(&mut paper, number), Some(Area::at(0, 0, 612, 20)));
    let bytes = paper.into_bytes();
    let bits = format!("1011{number:032b}01");
    for (place, pixel) in bytes.as_chunks::<4>().0.iter().enumerate() {
        let (x, y) = (place % 612, place / 612);
        let quiet = !(2..610).contains(&x) || !(2..18).contains(&y);
        let value = if quiet {
            128
        } else if bits.as_bytes()[(x - 2) / 16] == b'1' {
            255
        } else {
            0
        };
        assert_eq!(*pixel, [value, value, value, 255], "{x} {y}");
    }
    assert_eq!(read_identity(&bytes, 612, 20), Some(number));
    assert_eq!(read_identity(&bytes, 611, 20), None);
    assert_eq!(read_identity(&bytes[4..], 612, 20), None);
    assert_eq!(read_identity(&[], 0, 0), None);
    assert_eq!(read_identity(&[], u32::MAX, u32::MAX), None);
}

#[test]
fn outputs_of_all_sizes_can_be_read() {
    for (size_px, side_px) in [
        ([16_384, 20], 16),
        ([1920, 1080], 16),
        ([612, 20], 16),
        ([612, 19], 8),
        ([611, 400], 8),
        ([320, 180], 8),
        ([307, 180], 4),
        ([100, 2000], 2),
        ([64, 48], 1),
        ([42, 5], 1),
    ] {
        let mut desktop = Desktop::new(size_px[0] as usize, size_px[1] as usize, noise);
        desktop.show([0, 0], size_px, "a", 1);
        let expected = FoundIdentity {
            number: identity("lab", "left", "a"),
            block_px: [2, 2],
            side_px,
        };
        assert_eq!(desktop.found(), [expected], "{size_px:?}");
    }
    let mut small = Desktop::new(41, 41, noise);
    small.show([0, 0], [41, 41], "a", 1);
    assert_eq!(small.found(), []);
}

#[test]
fn every_window_on_a_desktop_is_found_and_nothing_else() {
    for ground in [|_, _| [128; 3], |_, _| [255; 3], |_, _| [0; 3], noise] {
        let mut desktop = Desktop::new(1600, 900, ground);
        desktop.show([1000, 3], [500, 200], "a", 1);
        desktop.show([17, 31], [640, 360], "b", 1);
        desktop.show([701, 333], [100, 80], "c", 3);
        // Cut off at the right edge within its strip; covered below.
        desktop.show([1500, 700], [400, 100], "cut", 1);
        desktop.show([30, 500], [640, 300], "covered", 1);
        desktop.show([300, 480], [330, 200], "d", 1);
        let found = desktop.found();
        let expected = [
            ("a", [1002, 5], 8),
            ("b", [19, 33], 16),
            ("c", [707, 339], 6),
            ("d", [302, 482], 8),
        ]
        .map(|(output, block_px, side_px)| FoundIdentity {
            number: identity("lab", "left", output),
            block_px,
            side_px,
        });
        assert_eq!(found, expected);
    }
}

#[test]
fn a_desktop_without_outputs_has_no_number() {
    let stripes = |x: usize, y: usize| [[128, 255, 0][(x / 3 + y / 7) % 3]; 3];
    for ground in [noise, |_, _| [128; 3], |_, _| [255; 3], stripes] {
        assert_eq!(Desktop::new(500, 300, ground).found(), []);
    }
    for pattern in [Pattern::Grid, Pattern::Bars, Pattern::Ramp, Pattern::Focus] {
        let about = About {
            size_px: [1280, 720],
            ..About::default()
        };
        assert_eq!(read_identity(&draw(pattern, &about), 1280, 720), None);
    }
}

#[test]
fn one_wrong_pixel_spoils_a_strip() {
    let mut desktop = Desktop::new(640, 40, noise);
    desktop.show([5, 7], [630, 30], "a", 1);
    let number = Some(identity("lab", "left", "a"));
    // Within a block, in the border above, below, left and right of the blocks.
    for (x, y) in [(300, 20), (100, 8), (200, 25), (6, 12), (615, 24)] {
        let mut bytes = desktop.bytes.clone();
        assert_eq!(read_identity(&bytes, 640, 40), number);
        bytes[4 * (y * 640 + x)..][..3].copy_from_slice(&[10, 200, 10]);
        assert_eq!(read_identity(&bytes, 640, 40), None, "{x} {y}");
    }
}
