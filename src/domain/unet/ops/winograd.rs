//! 3×3 convolutions with fewer multiplications: Winograd's F(2×2, 3×3) (Lavin and Gray, "Fast algorithms for convolutional
//! neural networks", CVPR 2016).
//!
//! The output is cut into tiles of two by two pixels. Each sees four by four pixels of the input; these are *spread* over 16
//! places, which are sums and differences of them, and so are the weights. Place by place the tiles are multiplied with the
//! weights, which is a product of matrices, `[tiles, inputs]` · `[inputs, outputs]`, and what comes out is *gathered* into
//! pixels. 16 multiplications do what takes 36, and no pixel's result depends on another input than its nine.
//!
//! In one dimension, of inputs d, weights g and outputs y:
//!
//! ```text
//! spread(d) = [d0 − d2, d1 + d2, d2 − d1, d3 − d1]        spread(g) = [g0, (g0 + g1 + g2)/2, (g0 − g1 + g2)/2, g2]
//! y0 = m0 + m1 + m2,  y1 = m1 − m2 + m3                   m = spread(d) · spread(g)
//! ```
//!
//! Of a map that is doubled, a tile sees each pixel as d = [a, b, b, c], so that one place of four is zero. What is left are
//! [a − b, b, c − b] with the weights [g0, g0 + g1 + g2, g2]: nine places in two dimensions in the place of 36 taps, and the
//! tiles are those of the map beside it, so that both are added up before they are gathered.
//!
//! All of it is linear, so the gradients are made of the transposes: that of a place's weights is a product of matrices,
//! `[inputs, tiles]` · `[tiles, outputs]`, of the spread input and the spread gradient of the output, y ↦ [y0, y0 + y1,
//! y0 − y1, y1].

use super::convolution::{Then, Weights, convolve};
use super::correlation::{Correlation, correlate};
use super::dispatch::dispatch;
use super::image::{Image, Source, Target};
use super::lanes::Lanes;
use crate::domain::unet::compute::Simd;

/// Places of a tile: four by four.
pub(super) const PLACES: usize = 16;
/// Those at which a tile of a doubled map is not zero.
pub(super) const DOUBLED: [usize; 9] = [0, 1, 3, 4, 5, 7, 12, 13, 15];

/// About so many tiles are handled at once, so that what is made of them stays in the second-level cache.
const BLOCK: usize = 64;
/// So many numbers lie between places besides their tiles: powers of two would fall on the same lines of the cache.
const GAP: usize = 16;

/// How a row (or column) of three weights is spread: a row of factors for each place.
pub(super) type Spread<const N: usize> = [[f32; 3]; N];
/// That of any map.
pub(super) const WHOLE_WEIGHTS: Spread<4> = [[1.0, 0.0, 0.0], [0.5, 0.5, 0.5], [0.5, -0.5, 0.5], [0.0, 0.0, 1.0]];
/// That of a map that is doubled.
pub(super) const DOUBLED_WEIGHTS: Spread<3> = [[1.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.0, 0.0, 1.0]];

/// Buffers for a block of tiles, used again for the next one.
#[derive(Debug, Clone, Default)]
pub(super) struct Tiles {
    /// The input, `[place][tile][input]`.
    whole: Vec<f32>,
    /// The map that is doubled, `[place of nine][tile][input]`.
    doubled: Vec<f32>,
    /// The output or its gradient, `[place][tile][output]`.
    outputs: Vec<f32>,
    /// What a map that is doubled gets back, `[place of nine][tile][input]`, for all of its tiles.
    back: Vec<f32>,
}

/// Some rows of tiles.
#[derive(Debug, Clone, Copy)]
struct Block {
    /// The first row of tiles.
    top: usize,
    /// Rows of tiles.
    height: usize,
    /// Tiles in a row.
    across: usize,
}

impl Block {
    /// Cuts a map into blocks.
    fn of(image: &Image) -> impl Iterator<Item = Self> + use<> {
        let [rows, across] = [image.rows / 2, image.cols / 2];
        assert!(image.rows == 2 * rows && image.cols == 2 * across && across > 0, "the map is made of tiles");
        let height = (BLOCK / across).clamp(1, rows.max(1));
        (0..rows).step_by(height).map(move |top| Self { top, height: height.min(rows - top), across })
    }

    const fn tiles(&self) -> usize {
        self.height * self.across
    }

    /// Returns how many numbers lie from one place to the next.
    const fn place(&self, channels: usize) -> usize {
        self.tiles() * channels + GAP
    }

    /// Makes room for so many places.
    fn room<'a>(&self, buffer: &'a mut Vec<f32>, places: usize, channels: usize) -> &'a mut [f32] {
        let length = places * self.place(channels);
        if buffer.len() < length {
            buffer.resize(length, 0.0);
        }
        &mut buffer[..length]
    }

    /// The tiles of a place, as pixels of one row.
    fn at<'a>(&self, buffer: &'a [f32], place: usize, channels: usize) -> Source<'a> {
        let (data, row) = (&buffer[place * self.place(channels)..], self.tiles() * channels);
        Source { data, row, pixel: channels, taps: [1, 1], tap_row: 0, tap_col: 0, channels }
    }

    /// The tiles of a place, to be written.
    fn target<'a>(&self, buffer: &'a mut [f32], place: usize, channels: usize) -> Target<'a> {
        let (data, row) = (&mut buffer[place * self.place(channels)..], self.tiles() * channels);
        Target { data, row, pixel: channels, rows: 1, cols: self.tiles(), channels }
    }
}

/// Returns the weights of a place.
fn weights(all: &[f32], place: usize, inputs: usize, outputs: usize) -> Weights<'_> {
    let length = inputs * outputs;
    Weights { data: &all[place * length..][..length], tap: 0 }
}

/// What is learned about a map that is doubled.
#[derive(Debug)]
pub(super) struct Small<'a> {
    pub(super) map: &'a Image,
    /// Its weights, turned: `[place of nine][output][input]`.
    pub(super) turned: &'a [f32],
    /// To these the gradient of its weights is added, `[place of nine][input][output]`.
    pub(super) sums: &'a mut [f32],
    /// What becomes of its gradient.
    pub(super) then: Then<'a>,
    pub(super) gradient: &'a mut Image,
}

impl Tiles {
    /// Computes a convolution with 3×3 taps and zeros around: of `whole` with its spread weights `[place][input][output]`
    /// and, where there is one, of a `small` map that is doubled with its own, `[place of nine][input][output]`, onto `bias`
    /// (empty for none).
    ///
    /// The target is as large as `whole`, with an even number of rows and columns.
    pub(super) fn convolve(
        &mut self,
        simd: Simd,
        (whole, whole_weights): (&Image, &[f32]),
        small: Option<(&Image, &[f32])>,
        bias: &[f32],
        then: Then<'_>,
        target: &mut Image,
    ) {
        let outputs = target.channels;
        for block in Block::of(target) {
            let spread = block.room(&mut self.whole, PLACES, whole.channels);
            spread_whole(simd, whole, block, spread);
            if let Some((small, _)) = small {
                spread_doubled(simd, small, block, block.room(&mut self.doubled, DOUBLED.len(), small.channels));
            }
            let products = block.room(&mut self.outputs, PLACES, outputs);
            let mut left = DOUBLED.iter().enumerate().peekable();
            for place in 0..PLACES {
                let beside = weights(whole_weights, place, whole.channels, outputs);
                let beside = (block.at(&self.whole, place, whole.channels), beside);
                let mut target = block.target(products, place, outputs);
                match (small, left.next_if(|(_, of)| **of == place)) {
                    (Some((small, small_weights)), Some((number, _))) => {
                        let below = weights(small_weights, number, small.channels, outputs);
                        let below = (block.at(&self.doubled, number, small.channels), below);
                        convolve(simd, &[below, beside], &[], Then::Nothing, &mut target);
                    }
                    _ => convolve(simd, &[beside], &[], Then::Nothing, &mut target),
                }
            }
            gather(simd, products, block, bias, then, target);
        }
    }

    /// Adds the gradient of the spread weights to `sums`, `[place][input][output]`, from an input and the gradient of the
    /// output; and where a `small` map is doubled beside it, the same for that, and computes its gradient.
    pub(super) fn correlate(
        &mut self,
        simd: Simd,
        whole: &Image,
        gradient: &Image,
        sums: &mut [f32],
        mut small: Option<Small<'_>>,
    ) {
        let outputs = gradient.channels;
        if let Some(Small { map, .. }) = &small {
            self.back.resize(DOUBLED.len() * map.rows * map.cols * map.channels, 0.0);
        }
        for block in Block::of(gradient) {
            let spread = block.room(&mut self.whole, PLACES, whole.channels);
            spread_whole(simd, whole, block, spread);
            spread_gradient(simd, gradient, block, block.room(&mut self.outputs, PLACES, outputs));
            let size = [1, block.tiles()];
            for (place, sums) in sums.chunks_exact_mut(whole.channels * outputs).enumerate() {
                let input = block.at(&self.whole, place, whole.channels);
                let gradient = block.at(&self.outputs, place, outputs);
                correlate(simd, &Correlation { input, gradient, size, tap: 0 }, sums);
            }
            let Some(Small { map, turned, sums, .. }) = &mut small else { continue };
            let inputs = map.channels;
            spread_doubled(simd, map, block, block.room(&mut self.doubled, DOUBLED.len(), inputs));
            for (number, (place, sums)) in DOUBLED.iter().zip(sums.chunks_exact_mut(inputs * outputs)).enumerate() {
                let input = block.at(&self.doubled, number, inputs);
                let gradient = block.at(&self.outputs, *place, outputs);
                correlate(simd, &Correlation { input, gradient, size, tap: 0 }, sums);
                let row = map.cols * inputs;
                let data = &mut self.back[(number * map.rows + block.top) * row..][..block.height * row];
                let mut back = Target {
                    data,
                    row: block.tiles() * inputs,
                    pixel: inputs,
                    rows: 1,
                    cols: block.tiles(),
                    channels: inputs,
                };
                let turned = weights(turned, number, outputs, inputs);
                convolve(simd, &[(gradient, turned)], &[], Then::Nothing, &mut back);
            }
        }
        if let Some(Small { map, then, gradient, .. }) = small {
            gradient.resize(map.rows, map.cols, map.channels);
            undouble(simd, &mut self.back, then, gradient);
        }
    }
}

/// Asserts that a block of tiles lies within a map and its places within a buffer.
fn check(image: &Image, pixels: usize, block: Block, places: usize, buffer: &[f32]) {
    assert_eq!(image.data.len(), (image.rows + 2) * (image.cols + 2) * image.channels, "a map has a border");
    assert!((block.top + block.height) * pixels <= image.rows, "rows of tiles lie within the map");
    assert_eq!(block.across * pixels, image.cols, "a row of tiles is as wide as the map");
    assert!(buffer.len() >= places * block.place(image.channels), "there is room for every tile");
    assert!(image.channels.is_multiple_of(16), "channels fill the registers of every instruction set");
}

/// Spreads the four by four pixels that each tile sees.
fn spread_whole(simd: Simd, image: &Image, block: Block, out: &mut [f32]) {
    check(image, 2, block, PLACES, out);
    dispatch!(simd, whole_tiles(image: &Image, block: Block, out: &mut [f32]));
}

/// Spreads the three by three pixels of a small map that each tile of the doubled one sees.
fn spread_doubled(simd: Simd, image: &Image, block: Block, out: &mut [f32]) {
    check(image, 1, block, DOUBLED.len(), out);
    dispatch!(simd, doubled_tiles(image: &Image, block: Block, out: &mut [f32]));
}

/// Spreads the gradients of the two by two pixels of each tile.
fn spread_gradient(simd: Simd, image: &Image, block: Block, out: &mut [f32]) {
    check(image, 2, block, PLACES, out);
    dispatch!(simd, gradient_tiles(image: &Image, block: Block, out: &mut [f32]));
}

/// Gathers the two by two pixels of each tile, adds the bias and writes them.
fn gather(simd: Simd, products: &[f32], block: Block, bias: &[f32], then: Then<'_>, target: &mut Image) {
    check(target, 2, block, PLACES, products);
    assert!(bias.is_empty() || bias.len() == target.channels, "one bias for each output channel");
    if let Then::Gate(gate) = then {
        assert!(gate.len() >= target.data.len() - target.first() - target.stride(), "the gate holds every pixel");
    }
    dispatch!(simd, gathered_tiles(products: &[f32], block: Block, bias: &[f32], then: Then<'_>, target: &mut Image));
}

/// Spreads four pixels of a row or column.
///
/// # Safety
/// The processor has the instruction set of `V`.
#[inline(always)]
unsafe fn four<V: Lanes>([a, b, c, d]: [V; 4]) -> [V; 4] {
    // SAFETY: as for this function.
    unsafe { [a.minus(c), b.plus(c), c.minus(b), d.minus(b)] }
}

/// # Safety
/// The processor has the instruction set of `V`, and [`check`] has passed.
#[inline(always)]
unsafe fn whole_tiles<V: Lanes>(image: &Image, block: Block, out: &mut [f32]) {
    let (channels, stride, place) = (image.channels, image.stride(), block.place(image.channels));
    // SAFETY: `check` has seen that the tiles lie within the map, their neighbors within its border, and all places within
    // the buffer.
    unsafe {
        for tile in 0..block.tiles() {
            let (row, col) = (block.top + tile / block.across, tile % block.across);
            let from = image.data.as_ptr().add(2 * row * stride + 2 * col * channels);
            let to = out.as_mut_ptr().add(tile * channels);
            for channel in (0..channels).step_by(V::COUNT) {
                let mut spread = [[V::zero(); 4]; 4];
                for (j, column) in spread.iter_mut().enumerate() {
                    let from = from.add(j * channels + channel);
                    *column = four([
                        V::load(from),
                        V::load(from.add(stride)),
                        V::load(from.add(2 * stride)),
                        V::load(from.add(3 * stride)),
                    ]);
                }
                let [a, b, c, d] = spread;
                for i in 0..4 {
                    for (j, value) in four([a[i], b[i], c[i], d[i]]).into_iter().enumerate() {
                        value.store(to.add((4 * i + j) * place + channel));
                    }
                }
            }
        }
    }
}

/// Spreads three pixels of a row or column that is doubled.
///
/// # Safety
/// The processor has the instruction set of `V`.
#[inline(always)]
unsafe fn three<V: Lanes>([a, b, c]: [V; 3]) -> [V; 3] {
    // SAFETY: as for this function.
    unsafe { [a.minus(b), b, c.minus(b)] }
}

/// # Safety
/// As for [`whole_tiles`].
#[inline(always)]
unsafe fn doubled_tiles<V: Lanes>(image: &Image, block: Block, out: &mut [f32]) {
    let (channels, stride, place) = (image.channels, image.stride(), block.place(image.channels));
    // SAFETY: as in `whole_tiles`.
    unsafe {
        for tile in 0..block.tiles() {
            let (row, col) = (block.top + tile / block.across, tile % block.across);
            let from = image.data.as_ptr().add(row * stride + col * channels);
            let to = out.as_mut_ptr().add(tile * channels);
            for channel in (0..channels).step_by(V::COUNT) {
                let mut spread = [[V::zero(); 3]; 3];
                for (j, column) in spread.iter_mut().enumerate() {
                    let from = from.add(j * channels + channel);
                    *column = three([V::load(from), V::load(from.add(stride)), V::load(from.add(2 * stride))]);
                }
                let [a, b, c] = spread;
                for i in 0..3 {
                    for (j, value) in three([a[i], b[i], c[i]]).into_iter().enumerate() {
                        value.store(to.add((3 * i + j) * place + channel));
                    }
                }
            }
        }
    }
}

/// Spreads the gradients of the two pixels of a row or column.
///
/// # Safety
/// The processor has the instruction set of `V`.
#[inline(always)]
unsafe fn two<V: Lanes>([a, b]: [V; 2]) -> [V; 4] {
    // SAFETY: as for this function.
    unsafe { [a, a.plus(b), a.minus(b), b] }
}

/// # Safety
/// As for [`whole_tiles`].
#[inline(always)]
unsafe fn gradient_tiles<V: Lanes>(image: &Image, block: Block, out: &mut [f32]) {
    let (channels, stride, place) = (image.channels, image.stride(), block.place(image.channels));
    // SAFETY: as in `whole_tiles`.
    unsafe {
        for tile in 0..block.tiles() {
            let (row, col) = (block.top + tile / block.across, tile % block.across);
            let from = image.data.as_ptr().add(image.first() + 2 * row * stride + 2 * col * channels);
            let to = out.as_mut_ptr().add(tile * channels);
            for channel in (0..channels).step_by(V::COUNT) {
                let from = from.add(channel);
                let left = two([V::load(from), V::load(from.add(stride))]);
                let from = from.add(channels);
                let right = two([V::load(from), V::load(from.add(stride))]);
                for (i, (left, right)) in left.into_iter().zip(right).enumerate() {
                    for (j, value) in two([left, right]).into_iter().enumerate() {
                        value.store(to.add((4 * i + j) * place + channel));
                    }
                }
            }
        }
    }
}

/// Gathers the two pixels of a row or column.
///
/// # Safety
/// The processor has the instruction set of `V`.
#[inline(always)]
unsafe fn pair<V: Lanes>([a, b, c, d]: [V; 4]) -> [V; 2] {
    // SAFETY: as for this function.
    unsafe { [a.plus(b).plus(c), b.minus(c).plus(d)] }
}

/// # Safety
/// As for [`whole_tiles`]; `bias` and a gate are as long as [`gather`] has seen.
#[inline(always)]
unsafe fn gathered_tiles<V: Lanes>(products: &[f32], block: Block, bias: &[f32], then: Then<'_>, target: &mut Image) {
    let (channels, stride, first) = (target.channels, target.stride(), target.first());
    let place = block.place(channels);
    // SAFETY: as in `whole_tiles`; bias and gate are as long as `gather` has seen.
    unsafe {
        for tile in 0..block.tiles() {
            let (row, col) = (block.top + tile / block.across, tile % block.across);
            let from = products.as_ptr().add(tile * channels);
            for channel in (0..channels).step_by(V::COUNT) {
                let mut columns = [[V::zero(); 2]; 4];
                for (j, column) in columns.iter_mut().enumerate() {
                    let from = from.add(j * place + channel);
                    *column = pair([
                        V::load(from),
                        V::load(from.add(4 * place)),
                        V::load(from.add(8 * place)),
                        V::load(from.add(12 * place)),
                    ]);
                }
                let bias = if bias.is_empty() { V::zero() } else { V::load(bias.as_ptr().add(channel)) };
                let [a, b, c, d] = columns;
                for i in 0..2 {
                    for (j, sum) in pair([a[i], b[i], c[i], d[i]]).into_iter().enumerate() {
                        let (sum, at) = (sum.plus(bias), (2 * row + i) * stride + (2 * col + j) * channels + channel);
                        then.applied(sum, at).store(target.data.as_mut_ptr().add(first + at));
                    }
                }
            }
        }
    }
}

/// Computes the gradient of a map that is doubled from that of its tiles, `[place of nine][tile][channel]`, which is used up.
///
/// A pixel is the b of its own tile, the a of the next and the c of the one before.
fn undouble(simd: Simd, back: &mut [f32], then: Then<'_>, gradient: &mut Image) {
    assert_eq!(
        back.len(),
        DOUBLED.len() * gradient.rows * gradient.cols * gradient.channels,
        "one tile for each pixel"
    );
    dispatch!(simd, plain undoubled(back: &mut [f32], then: Then<'_>, gradient: &mut Image));
}

#[inline(always)]
fn undoubled(back: &mut [f32], then: Then<'_>, gradient: &mut Image) {
    let (rows, channels, stride) = (gradient.rows, gradient.channels, gradient.stride());
    let row = gradient.cols * channels;
    let place = rows * row;
    for three in back.chunks_exact_mut(3 * place) {
        let (a, others) = three.split_at_mut(place);
        let (b, c) = others.split_at_mut(place);
        for ((b, a), c) in b.chunks_exact_mut(row).zip(a.chunks_exact(row)).zip(c.chunks_exact(row)) {
            subtract(b, a, c);
            add(b, &a[channels..]);
            add(&mut b[channels..], c);
        }
    }
    let of = |i: usize| back[(3 * i + 1) * place..][..place].chunks_exact(row);
    let (a, c) = (of(0), of(2));
    for (r, ((b, own_a), own_c)) in of(1).zip(a.clone()).zip(c.clone()).enumerate() {
        let out = gradient.row_mut(r);
        out.copy_from_slice(b);
        subtract(out, own_a, own_c);
        if let Some(after) = a.clone().nth(r + 1) {
            add(out, after);
        }
        if let Some(before) = r.checked_sub(1).and_then(|r| c.clone().nth(r)) {
            add(out, before);
        }
        match then {
            Then::Nothing => {}
            Then::Relu => out.iter_mut().for_each(|out| *out = if *out > 0.0 { *out } else { 0.0 }),
            Then::Gate(gate) => {
                let gate = &gate[r * stride..][..row];
                out.iter_mut().zip(gate).for_each(|(out, gate)| *out = if *gate > 0.0 { *out } else { 0.0 });
            }
        }
    }
}

/// Subtracts two lines from another.
#[inline(always)]
fn subtract(from: &mut [f32], a: &[f32], c: &[f32]) {
    for ((from, a), c) in from.iter_mut().zip(a).zip(c) {
        *from = (*from - a) - c;
    }
}

/// Adds what there is of one line to another.
#[inline(always)]
fn add(to: &mut [f32], from: &[f32]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += from;
    }
}
