//! The 255 colours that stand for all colours of an animation, by median cut (Heckbert, "Color image
//! quantization for frame buffer display", 1982).

use super::Picture;

/// Colours are counted in cells: this many bits per channel.
const BITS: u32 = 5;
const N_CELLS: usize = 1 << (3 * BITS);

pub(super) struct Palette {
    rgb: Vec<u8>,
    /// The palette's index for each cell.
    indices: Vec<u8>,
}

/// The colours of a cell: their number and the sum of each channel.
#[derive(Clone, Copy, Default)]
struct Count {
    pixels: u64,
    sum: [u64; 3],
}

impl Count {
    fn add(&mut self, pixels: u64, sum: [u64; 3]) {
        self.pixels += pixels;
        for (total, value) in self.sum.iter_mut().zip(sum) {
            *total += value;
        }
    }

    /// The mean colour.
    fn mean(&self) -> [u8; 3] {
        self.sum.map(|sum| ((sum + self.pixels / 2) / self.pixels.max(1)) as u8)
    }
}

fn cell(rgb: &[u8]) -> usize {
    rgb.iter().fold(0, |cell, &value| cell << BITS | usize::from(value >> (8 - BITS)))
}

/// The coordinate of a cell along a channel.
fn coordinate(cell: usize, channel: usize) -> usize {
    cell >> (BITS as usize * (2 - channel)) & ((1 << BITS) - 1)
}

/// The colours of some pictures.
pub(super) struct Colours(Vec<Count>);

impl Colours {
    /// Those of no picture.
    pub fn new() -> Colours {
        Colours(vec![Count::default(); N_CELLS])
    }

    /// Counts those of one more picture.
    pub fn count(&mut self, picture: &Picture) {
        for rgb in picture.rgb.chunks_exact(3) {
            self.0[cell(rgb)].add(1, [rgb[0], rgb[1], rgb[2]].map(u64::from));
        }
    }

    /// The palette of the pictures.
    pub fn palette(&self) -> Palette {
        let Colours(counts) = self;
        let mut palette = Palette { rgb: Vec::new(), indices: vec![0; N_CELLS] };
        for (index, cells) in boxes(counts, usize::from(Palette::TRANSPARENT)).iter().enumerate() {
            let mut total = Count::default();
            cells.iter().for_each(|&cell| total.add(counts[cell].pixels, counts[cell].sum));
            palette.rgb.extend(total.mean());
            cells.iter().for_each(|&cell| palette.indices[cell] = index as u8);
        }
        palette.rgb.resize(256 * 3, 0);
        palette
    }
}

impl Palette {
    /// The index that stands for no change.
    pub const TRANSPARENT: u8 = 255;

    /// Red, green and blue of 256 colours.
    pub fn rgb(&self) -> &[u8] {
        &self.rgb
    }

    /// The index of a colour that one of the pictures has.
    pub fn index(&self, rgb: &[u8]) -> u8 {
        self.indices[cell(rgb)]
    }
}

/// Divides the cells that occur into at most `n` boxes.
fn boxes(counts: &[Count], n: usize) -> Vec<Vec<usize>> {
    let used: Vec<usize> = (0..counts.len()).filter(|&cell| counts[cell].pixels > 0).collect();
    let mut boxes = vec![used];
    while boxes.len() < n {
        // The square root keeps a large even background from taking all the colours.
        let weight = |cells: &Vec<usize>| {
            let pixels: u64 = cells.iter().map(|&cell| counts[cell].pixels).sum();
            (pixels as f64).sqrt() * widest(cells).1 as f64
        };
        let heaviest = (0..boxes.len()).max_by(|&a, &b| weight(&boxes[a]).total_cmp(&weight(&boxes[b])));
        let Some(heaviest) = heaviest.filter(|&i| widest(&boxes[i]).1 > 0) else { break };
        let upper = split(&mut boxes[heaviest], counts);
        boxes.push(upper);
    }
    boxes
}

/// The channel along which cells differ most, and by how much.
fn widest(cells: &[usize]) -> (usize, usize) {
    let extent = |channel: usize| {
        let coordinates = || cells.iter().map(|&cell| coordinate(cell, channel));
        coordinates().max().unwrap_or(0) - coordinates().min().unwrap_or(0)
    };
    let channel = (0..3).max_by_key(|&channel| extent(channel)).unwrap_or(0);
    (channel, extent(channel))
}

/// Removes the upper half of a box's pixels along its widest channel, and at least one cell.
fn split(cells: &mut Vec<usize>, counts: &[Count]) -> Vec<usize> {
    let (channel, _) = widest(cells);
    cells.sort_by_key(|&cell| (coordinate(cell, channel), cell));
    let total: u64 = cells.iter().map(|&cell| counts[cell].pixels).sum();
    let mut below = 0;
    let half = cells.iter().position(|&cell| {
        below += counts[cell].pixels;
        2 * below >= total
    });
    let at = half.map_or(1, |half| half + 1).clamp(1, cells.len() - 1);
    cells.split_off(at)
}
