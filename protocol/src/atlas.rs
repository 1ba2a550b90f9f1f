//! Many small pictures in one: where each lies.

/// Where a picture lies in an atlas, pixels without its border.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct Place {
    pub x: u32,
    pub y: u32,
    pub width: u32,
    pub height: u32,
}

/// The places of all pictures and the size of the atlas that holds them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// One per picture, in the order given.
    pub places: Vec<Place>,
}

/// Narrowest atlas tried, pixels.
const NARROWEST_PX: u32 = 128;

/// The smallest of the shelf layouts of widths 128, 256, … pixels up to `side_px`, or `None` when none fits. Every picture has `gutter_px` free
/// pixels round it.
#[must_use]
pub fn place(sizes: &[(u32, u32)], gutter_px: u32, side_px: u32) -> Option<Layout> {
    let widths = std::iter::successors(Some(NARROWEST_PX), |width| width.checked_mul(2));
    widths
        .take_while(|width| *width <= side_px)
        .filter_map(|width| shelves(sizes, width, gutter_px, side_px))
        .min_by_key(|layout| (u64::from(layout.width) * u64::from(layout.height), layout.width))
}

/// Tallest first, left to right, shelf under shelf. The height is a multiple of 16, a block of subsampled JPEG.
fn shelves(sizes: &[(u32, u32)], width: u32, gutter_px: u32, side_px: u32) -> Option<Layout> {
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    let size = |index: usize| sizes.get(index).copied().unwrap_or((1, 1));
    order.sort_by_key(|&index| std::cmp::Reverse((size(index).1, size(index).0)));
    let mut places = vec![Place { x: 0, y: 0, width: 1, height: 1 }; sizes.len()];
    let (mut x, mut y, mut shelf) = (0u32, 0u32, 0u32);
    for index in order {
        let (own_width, own_height) = size(index);
        let (full_width, full_height) =
            (own_width.checked_add(2 * gutter_px)?, own_height.checked_add(2 * gutter_px)?);
        if full_width > width || full_height > side_px {
            return None;
        }
        if x + full_width > width {
            (x, y, shelf) = (0, y + shelf, 0);
        }
        shelf = shelf.max(full_height);
        if y + shelf > side_px {
            return None;
        }
        if let Some(place) = places.get_mut(index) {
            *place = Place { x: x + gutter_px, y: y + gutter_px, width: own_width, height: own_height };
        }
        x += full_width;
    }
    let height = (y + shelf).max(1).next_multiple_of(16);
    Some(Layout { width, height, places })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn pictures_never_overlap_and_stay_inside(
            sizes in proptest::collection::vec((1..300u32, 1..400u32), 1..40), gutter in 0..3u32,
        ) {
            let layout = place(&sizes, gutter, 4096).unwrap();
            let bounds = |p: &Place| (p.x - gutter, p.y - gutter, p.x + p.width + gutter, p.y + p.height + gutter);
            for (index, a) in layout.places.iter().enumerate() {
                prop_assert_eq!((a.width, a.height), sizes[index]);
                let a = bounds(a);
                prop_assert!(a.2 <= layout.width && a.3 <= layout.height);
                for b in &layout.places[index + 1..] {
                    let b = bounds(b);
                    prop_assert!(a.2 <= b.0 || b.2 <= a.0 || a.3 <= b.1 || b.3 <= a.1);
                }
            }
            prop_assert!(layout.width.max(layout.height) <= 4096);
        }
    }

    #[test]
    fn what_does_not_fit_has_no_layout() {
        assert_eq!(place(&[(5000, 10)], 0, 4096), None);
        assert_eq!(place(&[(u32::MAX, 10)], 2, u32::MAX), None);
        assert_eq!(place(&[(100, 100); 4], 0, 128), None);
    }
}
