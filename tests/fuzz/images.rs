//! PGM, PNG and JPEG through the import of maps.

use std::io::Cursor;

use image::{DynamicImage, GrayImage, ImageFormat, Luma};
use trodden::domain::map::{ImportConfig, MapYaml, import_igibson, import_image, import_ros};

use super::Target;
use super::mutate::{Dice, bytes, number, times};

const COLS: usize = 24;
const ROWS: usize = 20;

pub fn target(name: &str) -> Option<Target> {
    let ros = |mode: &str| {
        let text = format!(
            "image: a.png\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n\
             mode: {mode}\n"
        );
        MapYaml::parse(&text).expect("a good description")
    };
    let modes = ["trinary", "scale", "raw"].map(ros);
    let config = ImportConfig { image_resolution: Some(0.1), ..ImportConfig::default() };
    // All ways share the decoders; an input goes one of them, told by its bytes, so that a case seldom decodes twice.
    let run = move |input: &[u8]| {
        let accepted = match input.iter().fold(0, |sum: usize, byte| sum + usize::from(*byte)) % 4 {
            0 => import_igibson(input, &ImportConfig::default()).is_ok(),
            way => import_ros(&modes[way - 1], input, &ImportConfig::default()).is_ok(),
        };
        accepted || import_image(input, &config).is_ok()
    };
    match name {
        "pgm" => Some(Target::new("pgm", pgms(), pgm, run)),
        "png" => Some(Target::new("png", pngs(), png, run)),
        "jpeg" => Some(Target::new("jpeg", jpegs(), jpeg, run)),
        _ => None,
    }
}

/// Two rooms with a door and unknown space around them.
fn gray(row: usize, col: usize) -> u8 {
    let edge = row < 2 || col < 2 || row >= ROWS - 2 || col >= COLS - 2;
    let wall = col == COLS / 2 && !(6..12).contains(&row);
    if edge {
        205
    } else if wall {
        0
    } else {
        254
    }
}

fn pixels() -> impl Iterator<Item = u8> {
    (0..ROWS).flat_map(|row| (0..COLS).map(move |col| gray(row, col)))
}

/// Returns an image that can be read.
pub fn good() -> Vec<u8> {
    pgms().remove(0)
}

fn pgms() -> Vec<Vec<u8>> {
    let header = |magic: &str, most: u32| format!("{magic}\n# CREATOR: map_saver 0.050 m/pix\n{COLS} {ROWS}\n{most}\n");
    let texts: Vec<String> = pixels().map(|value| value.to_string()).collect();
    let bits: Vec<u8> = pixels().map(|value| if value == 254 { b'0' } else { b'1' }).collect();
    let deep: Vec<u8> = pixels().flat_map(|value| [value, value]).collect();
    let colors: Vec<u8> = pixels().flat_map(|value| [value; 3]).collect();
    vec![
        [header("P5", 255).into_bytes(), pixels().collect()].concat(),
        [header("P5", 65535).into_bytes(), deep].concat(),
        [header("P5", 100).into_bytes(), pixels().map(|value| value / 3).collect()].concat(),
        [header("P2", 255), texts.join(" ")].concat().into_bytes(),
        [header("P6", 255).into_bytes(), colors].concat(),
        [format!("P1\n{COLS} {ROWS}\n").into_bytes(), bits].concat(),
        [format!("P4\n{COLS} {ROWS}\n").into_bytes(), vec![0; COLS.div_ceil(8) * ROWS]].concat(),
        [
            format!("P7\nWIDTH {COLS}\nHEIGHT {ROWS}\nDEPTH 2\nMAXVAL 255\nTUPLTYPE GRAYSCALE_ALPHA\nENDHDR\n")
                .into_bytes(),
            vec![255; 2 * COLS * ROWS],
        ]
        .concat(),
    ]
}

/// Edges of images at which limits lie.
const SIDES: [u16; 8] = [0, 1, 5000, 8000, 9459, 13000, 20000, 65535];

fn pgm(dice: &mut Dice, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut input = dice.of(seeds).clone();
    times(dice, |dice| {
        if dice.one_in(2) {
            // The header is what decides.
            let mut header = input[..input.len().min(64)].to_vec();
            let rest = input.split_off(header.len());
            if dice.one_in(2) {
                number(dice, &mut header)
            } else {
                bytes(dice, &mut header, seeds)
            }
            header.extend(rest);
            input = header;
        } else {
            bytes(dice, &mut input, seeds);
        }
    });
    input
}

/// A part of a PNG: its type and data.
type Chunk = ([u8; 4], Vec<u8>);

const SIGNATURE: [u8; 8] = [0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a];

fn pngs() -> Vec<Vec<u8>> {
    let layouts: [(u8, u8, usize); 15] = [
        // Color type, bits of a channel, channels.
        (0, 8, 1),
        (0, 1, 1),
        (0, 2, 1),
        (0, 4, 1),
        (0, 16, 1),
        (2, 8, 3),
        (2, 16, 3),
        (3, 8, 1),
        (3, 4, 1),
        (3, 2, 1),
        (3, 1, 1),
        (4, 8, 2),
        (4, 16, 2),
        (6, 8, 4),
        (6, 16, 4),
    ];
    let mut all = Vec::new();
    for (color, depth, channels) in layouts {
        let header = [&(COLS as u32).to_be_bytes()[..], &(ROWS as u32).to_be_bytes(), &[depth, color, 0, 0, 0]];
        let line = (COLS * channels * usize::from(depth)).div_ceil(8);
        let mut raw = Vec::new();
        for row in 0..ROWS {
            // Every other row as it is, the next one by its difference to the one above: none.
            let (filter, shown) = if row % 2 == 0 { (0, 0xff) } else { (2, 0) };
            raw.push(filter);
            let white = |value: u8| if depth < 8 && value > 205 { 0xff } else { value };
            raw.extend((0..line).map(|at| white(gray(row, at * COLS / line)) & shown));
        }
        let mut chunks: Vec<Chunk> = vec![(*b"IHDR", header.concat())];
        if color == 3 {
            let last = (1usize << depth) - 1;
            chunks.push((*b"PLTE", (0..3 * (last + 1)).map(|at| (at / 3 * 255 / last) as u8).collect()));
            chunks.push((*b"tRNS", vec![0]));
        } else if color == 0 {
            chunks.push((*b"tRNS", vec![0, 0]));
        }
        chunks.push((*b"gAMA", vec![0, 0, 0xb1, 0x8f]));
        chunks.push((*b"pHYs", vec![0, 0, 0x0b, 0x13, 0, 0, 0x0b, 0x13, 1]));
        chunks.push((*b"tEXt", b"Software\0map".to_vec()));
        chunks.push((*b"IDAT", stored(&raw)));
        chunks.push((*b"IEND", Vec::new()));
        all.push(joined(&chunks, |_| true));
    }
    let mut compressed = Cursor::new(Vec::new());
    picture().write_to(&mut compressed, ImageFormat::Png).expect("an image");
    all.push(compressed.into_inner());
    all
}

fn picture() -> DynamicImage {
    DynamicImage::ImageLuma8(GrayImage::from_fn(COLS as u32, ROWS as u32, |x, y| Luma([gray(y as usize, x as usize)])))
}

/// Packs bytes as zlib does, without compressing them.
fn stored(raw: &[u8]) -> Vec<u8> {
    let mut out = vec![0x78, 0x01];
    let blocks: Vec<&[u8]> = if raw.is_empty() { vec![raw] } else { raw.chunks(0xffff).collect() };
    for (i, block) in blocks.iter().enumerate() {
        let length = u16::try_from(block.len()).expect("a block's length");
        out.push(u8::from(i + 1 == blocks.len()));
        out.extend(length.to_le_bytes());
        out.extend((!length).to_le_bytes());
        out.extend_from_slice(block);
    }
    let (mut a, mut b) = (1u32, 0u32);
    for byte in raw {
        a = (a + u32::from(*byte)) % 65521;
        b = (b + a) % 65521;
    }
    out.extend((b << 16 | a).to_be_bytes());
    out
}

fn unstored(packed: &[u8]) -> Vec<u8> {
    let mut raw = Vec::new();
    let mut rest = packed.get(2..).unwrap_or_default();
    while let [0 | 1, low, high, _, _, after @ ..] = rest {
        let length = usize::from(u16::from_le_bytes([*low, *high])).min(after.len());
        raw.extend_from_slice(&after[..length]);
        rest = &after[length..];
    }
    raw
}

fn crc(bytes: impl Iterator<Item = u8>) -> u32 {
    !bytes.fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

/// Writes chunks; `right` says for each whether its checksum is to be right.
fn joined(chunks: &[Chunk], mut right: impl FnMut(usize) -> bool) -> Vec<u8> {
    let mut out = SIGNATURE.to_vec();
    for (i, (name, data)) in chunks.iter().enumerate() {
        out.extend((data.len() as u32).to_be_bytes());
        out.extend(name);
        out.extend(data);
        let sum = crc(name.iter().chain(data).copied());
        out.extend((if right(i) { sum } else { !sum }).to_be_bytes());
    }
    out
}

fn split(png: &[u8]) -> Vec<Chunk> {
    let mut chunks = Vec::new();
    let mut rest = &png[SIGNATURE.len()..];
    while let [a, b, c, d, n0, n1, n2, n3, after @ ..] = rest {
        let length = u32::from_be_bytes([*a, *b, *c, *d]) as usize;
        chunks.push(([*n0, *n1, *n2, *n3], after[..length].to_vec()));
        rest = &after[length + 4..];
    }
    chunks
}

fn png(dice: &mut Dice, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut chunks = split(dice.of::<Vec<u8>>(seeds));
    times(dice, |dice| {
        let (at, to) = (dice.below(chunks.len()), dice.below(chunks.len()));
        match dice.below(10) {
            0 => chunks.swap(at, to),
            1 => chunks.insert(to, chunks[at].clone()),
            2 if chunks.len() > 1 => drop(chunks.remove(at)),
            3 => {
                let foreign = split(dice.of::<Vec<u8>>(seeds));
                chunks.insert(to, dice.of(&foreign).clone());
            }
            4 => {
                chunks[at].0 =
                    *dice.of(&[*b"IDAT", *b"PLTE", *b"tRNS", *b"acTL", *b"fcTL", *b"iCCP", *b"zTXt", *b"abcd"])
            }
            5 | 6 => {
                let named = chunks.iter_mut().filter(|chunk| &chunk.0 == b"IDAT").last();
                if let Some((_, data)) = named {
                    let mut raw = unstored(data);
                    bytes(dice, &mut raw, seeds);
                    *data = stored(&raw);
                }
            }
            7 if dice.one_in(100) => {
                let side = |dice: &mut Dice| u32::from(*dice.of(&SIDES)).to_be_bytes();
                let sides = [side(dice), side(dice)].concat();
                if let Some(place) = chunks[0].1.get_mut(..8) {
                    place.copy_from_slice(&sides);
                }
            }
            7 => bytes(dice, &mut chunks[0].1, seeds),
            _ => bytes(dice, &mut chunks[at].1, seeds),
        }
    });
    let mut out = joined(&chunks, |_| !dice.one_in(40));
    if dice.one_in(10) {
        bytes(dice, &mut out, seeds);
    }
    out
}

fn jpegs() -> Vec<Vec<u8>> {
    let encode = |image: DynamicImage| {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, ImageFormat::Jpeg).expect("an image");
        bytes.into_inner()
    };
    vec![encode(picture()), encode(DynamicImage::ImageRgb8(picture().to_rgb8()))]
}

/// Parts of a JPEG: segments with their markers, and what follows a start of scan.
fn segments(jpeg: &[u8]) -> Vec<(u8, Vec<u8>)> {
    let mut parts = Vec::new();
    let mut rest = &jpeg[2..];
    while let [0xff, marker, high, low, after @ ..] = rest {
        let length = usize::from(u16::from_be_bytes([*high, *low])) - 2;
        // A scan goes on to the end of the image.
        let end = if *marker == 0xda { after.len() } else { length };
        parts.push((*marker, after[..end].to_vec()));
        rest = &after[end..];
    }
    parts
}

fn jpeg(dice: &mut Dice, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut parts = segments(dice.of::<Vec<u8>>(seeds));
    times(dice, |dice| {
        let (at, to) = (dice.below(parts.len()), dice.below(parts.len()));
        match dice.below(9) {
            0 => parts.swap(at, to),
            1 => parts.insert(to, parts[at].clone()),
            2 if parts.len() > 1 => drop(parts.remove(at)),
            3 => {
                let foreign = segments(dice.of::<Vec<u8>>(seeds));
                parts.insert(to, dice.of(&foreign).clone());
            }
            4 => parts[at].0 = *dice.of(&[0xc0, 0xc1, 0xc2, 0xc4, 0xcc, 0xdb, 0xdd, 0xe0, 0xe1, 0xee, 0xd0]),
            5 => {
                if let Some((_, frame)) = parts.iter_mut().find(|part| (0xc0..=0xc2).contains(&part.0)) {
                    if dice.one_in(100) {
                        let sides = [dice.of(&SIDES).to_be_bytes(), dice.of(&SIDES).to_be_bytes()].concat();
                        if let Some(place) = frame.get_mut(1..5) {
                            place.copy_from_slice(&sides);
                        }
                    } else {
                        bytes(dice, frame, seeds);
                    }
                }
            }
            _ => bytes(dice, &mut parts[at].1, seeds),
        }
    });
    let mut out = vec![0xff, 0xd8];
    for (marker, data) in parts {
        // The header of a scan names its components; what follows belongs to no segment.
        let components = data.first().map_or(0, |count| usize::from(*count));
        let length = if marker == 0xda { 6 + 2 * components } else { data.len() + 2 };
        out.extend([0xff, marker]);
        out.extend((length as u16).to_be_bytes());
        out.extend(data);
    }
    // Without its end a JPEG is refused at once.
    if !out.ends_with(&[0xff, 0xd9]) && !dice.one_in(10) {
        out.extend([0xff, 0xd9]);
    }
    out
}
