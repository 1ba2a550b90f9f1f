//! Cuts a picture in overlapping square tiles of the network's size.
//!
//! Tiles are spread evenly, so that the last row and column end with the picture and nobody is searched in padding.

/// Side of a tile, pixels: the network's input.
pub(super) const TILE_PX: u32 = 416;
/// Neighbouring tiles share at least this part, which is more than a player of the expected height.
const OVERLAP: f64 = 0.25;
/// Largest picture that is searched, a side: 8K and then some.
pub(super) const SIDE_MAX_PX: u32 = 8192;

/// A square of the picture; reaches outside only where the picture is smaller than a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tile {
    /// Left column.
    pub(super) x: u32,
    /// Top row.
    pub(super) y: u32,
    /// Which edges lie inside the picture, so that a person may be cut there: left, top, right, bottom.
    pub(super) inner: Edges,
}

/// A set of edges of a box or tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Edges {
    pub(super) left: bool,
    pub(super) top: bool,
    pub(super) right: bool,
    pub(super) bottom: bool,
}

impl Edges {
    pub(super) fn any(self) -> bool {
        self.left || self.top || self.right || self.bottom
    }
}

/// The tiles that cover a picture, row by row.
pub(super) fn layout(width_px: u32, height_px: u32) -> Vec<Tile> {
    let columns = starts(width_px);
    let rows = starts(height_px);
    let mut tiles = Vec::with_capacity(columns.len() * rows.len());
    for &y in &rows {
        for &x in &columns {
            let inner = Edges {
                left: x > 0,
                top: y > 0,
                right: x + TILE_PX < width_px,
                bottom: y + TILE_PX < height_px,
            };
            tiles.push(Tile { x, y, inner });
        }
    }
    tiles
}

fn starts(length_px: u32) -> Vec<u32> {
    let Some(spare) = length_px.checked_sub(TILE_PX).filter(|&spare| spare > 0) else {
        return vec![0];
    };
    let steps = (f64::from(spare) / (f64::from(TILE_PX) * (1.0 - OVERLAP))).ceil() as u32;
    (0..=steps).map(|i| (f64::from(spare) * f64::from(i) / f64::from(steps)).round() as u32).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_720p_picture_takes_eight_tiles() {
        assert_eq!(layout(1280, 720).len(), 8);
    }

    #[test]
    fn a_small_picture_is_one_tile_without_inner_edges() {
        assert_eq!(layout(300, 200), [Tile { x: 0, y: 0, inner: Edges::default() }]);
    }

    proptest! {
        #[test]
        fn tiles_cover_the_picture_and_overlap(length in 1u32..6000) {
            let starts = starts(length);
            prop_assert_eq!(starts[0], 0);
            prop_assert!(starts[starts.len() - 1] + TILE_PX >= length);
            prop_assert!(length <= TILE_PX || starts[starts.len() - 1] + TILE_PX == length);
            for pair in starts.windows(2) {
                prop_assert!(pair[1] > pair[0]);
                prop_assert!(pair[0] + TILE_PX >= pair[1] + (f64::from(TILE_PX) * OVERLAP) as u32 - 1);
            }
        }
    }
}
