//! A picture of yes and no, with the few operations of mathematical morphology that outlines need.

/// Cells in rows; those outside count as no.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::placement) struct Mask {
    columns: usize,
    rows: usize,
    cells: Vec<bool>,
}

impl Mask {
    pub(in crate::placement) fn new(columns: usize, rows: usize) -> Self {
        Self { columns, rows, cells: vec![false; columns * rows] }
    }

    pub(in crate::placement) fn columns(&self) -> usize {
        self.columns
    }

    pub(in crate::placement) fn get(&self, cell: usize) -> bool {
        self.cells.get(cell).copied().unwrap_or(false)
    }

    /// The cell at a column and row that may lie outside.
    pub(in crate::placement) fn at(&self, column: i64, row: i64) -> bool {
        let inside = (0..self.columns as i64).contains(&column) && (0..self.rows as i64).contains(&row);
        inside && self.get(row as usize * self.columns + column as usize)
    }

    pub(in crate::placement) fn set(&mut self, cell: usize, value: bool) {
        if let Some(slot) = self.cells.get_mut(cell) {
            *slot = value;
        }
    }

    /// The cells that are set, in order.
    pub(in crate::placement) fn cells(&self) -> impl Iterator<Item = usize> {
        self.cells.iter().enumerate().filter_map(|(cell, set)| set.then_some(cell))
    }

    pub(in crate::placement) fn count(&self) -> usize {
        self.cells.iter().filter(|set| **set).count()
    }

    pub(in crate::placement) fn inverted(&self) -> Self {
        Self { cells: self.cells.iter().map(|set| !set).collect(), ..*self }
    }

    pub(in crate::placement) fn join(&mut self, other: &Self) {
        for (own, other) in self.cells.iter_mut().zip(&other.cells) {
            *own |= other;
        }
    }

    pub(in crate::placement) fn intersect(&mut self, other: &Self) {
        for (own, other) in self.cells.iter_mut().zip(&other.cells) {
            *own &= other;
        }
    }

    pub(in crate::placement) fn subtract(&mut self, other: &Self) {
        for (own, other) in self.cells.iter_mut().zip(&other.cells) {
            *own &= !other;
        }
    }

    /// Grown by a square of `radius` cells to every side.
    pub(in crate::placement) fn dilated(&self, radius: usize) -> Self {
        let mut wide = Self::new(self.columns, self.rows);
        for (out, line) in
            wide.cells.chunks_exact_mut(self.columns).zip(self.cells.chunks_exact(self.columns))
        {
            spread(line.iter().copied(), out.iter_mut(), radius);
        }
        let mut tall = Self::new(self.columns, self.rows);
        for column in 0..self.columns {
            let line = wide.cells.iter().skip(column).step_by(self.columns).copied();
            spread(line, tall.cells.iter_mut().skip(column).step_by(self.columns), radius);
        }
        tall
    }

    /// Gaps up to twice `radius` bridged; the rim has to be at least as wide.
    pub(in crate::placement) fn closed(&self, radius: usize) -> Self {
        self.dilated(radius).inverted().dilated(radius).inverted()
    }

    /// What is narrower than twice `radius` taken away.
    pub(in crate::placement) fn opened(&self, radius: usize) -> Self {
        self.inverted().dilated(radius).inverted().dilated(radius)
    }

    /// Pieces of at least `least` cells that hang together by edges, in the order of their first cells.
    pub(in crate::placement) fn components(&self, least: usize) -> Vec<Self> {
        let mut left = self.clone();
        let mut pieces = Vec::new();
        let mut cells = Vec::new();
        for start in 0..self.cells.len() {
            if left.get(start) {
                cells.clear();
                left.take_connected(start, &mut cells);
                if cells.len() >= least {
                    let mut piece = Self::new(self.columns, self.rows);
                    cells.iter().for_each(|cell| piece.set(*cell, true));
                    pieces.push(piece);
                }
            }
        }
        pieces
    }

    /// The largest piece; the first of equals. Empty when nothing is set.
    pub(in crate::placement) fn largest_component(&self) -> Self {
        let mut left = self.clone();
        let (mut best, mut cells) = (Vec::new(), Vec::new());
        for start in 0..self.cells.len() {
            if left.get(start) {
                cells.clear();
                left.take_connected(start, &mut cells);
                if cells.len() > best.len() {
                    std::mem::swap(&mut best, &mut cells);
                }
            }
        }
        let mut piece = Self::new(self.columns, self.rows);
        best.iter().for_each(|cell| piece.set(*cell, true));
        piece
    }

    /// Moves the cells that hang together with `start` into `piece`.
    fn take_connected(&mut self, start: usize, piece: &mut Vec<usize>) {
        let mut stack = vec![start];
        self.set(start, false);
        while let Some(cell) = stack.pop() {
            piece.push(cell);
            let column = cell % self.columns;
            let neighbours = [
                (column > 0).then(|| cell - 1),
                (column + 1 < self.columns).then_some(cell + 1),
                cell.checked_sub(self.columns),
                Some(cell + self.columns),
            ];
            for neighbour in neighbours.into_iter().flatten() {
                if self.get(neighbour) {
                    self.set(neighbour, false);
                    stack.push(neighbour);
                }
            }
        }
    }

    /// The same with every enclosed gap filled. The rim has to be empty.
    pub(in crate::placement) fn with_holes_filled(&self) -> Self {
        let mut around = Vec::new();
        self.inverted().take_connected(0, &mut around);
        let mut outside = Self::new(self.columns, self.rows);
        around.iter().for_each(|cell| outside.set(*cell, true));
        outside.inverted()
    }

    /// Radius in cells of the largest disc of set cells (two-pass chamfer distance, Borgefors 1986; 8 % exact).
    pub(in crate::placement) fn largest_disc(&self) -> f64 {
        let (columns, rows) = (self.columns as i64, self.rows as i64);
        let mut distance: Vec<f64> = self.cells.iter().map(|set| if *set { f64::MAX } else { 0.0 }).collect();
        let mut pass = |cells: &mut dyn Iterator<Item = i64>, steps: [(i64, i64, f64); 4]| {
            for cell in cells {
                let (column, row) = (cell % columns, cell / columns);
                let mut best = distance.get(cell as usize).copied().unwrap_or(0.0);
                for (right, down, length) in steps {
                    let (x, y) = (column + right, row + down);
                    let inside = (0..columns).contains(&x) && (0..rows).contains(&y);
                    let near = if inside {
                        distance.get((y * columns + x) as usize).copied().unwrap_or(0.0)
                    } else {
                        0.0
                    };
                    best = best.min(near + length);
                }
                if let Some(slot) = distance.get_mut(cell as usize) {
                    *slot = best;
                }
            }
        };
        let slant = std::f64::consts::SQRT_2;
        let cells = columns * rows;
        pass(&mut (0..cells), [(-1, 0, 1.0), (0, -1, 1.0), (-1, -1, slant), (1, -1, slant)]);
        pass(&mut (0..cells).rev(), [(1, 0, 1.0), (0, 1, 1.0), (1, 1, slant), (-1, 1, slant)]);
        // Distances are between middles of cells: the free one ends half a cell before the first that is not.
        (distance.into_iter().fold(0.0, f64::max) - 0.5).max(0.0)
    }
}

/// Sets every cell within `radius` of a set one along a line.
fn spread<'a>(line: impl Iterator<Item = bool>, out: impl Iterator<Item = &'a mut bool>, radius: usize) {
    let line: Vec<bool> = line.collect();
    let mut last: Option<usize> = None;
    let mut ahead = 0;
    for (index, slot) in out.enumerate() {
        while ahead < line.len() && ahead <= index + radius {
            if line.get(ahead).copied().unwrap_or(false) {
                last = Some(ahead);
            }
            ahead += 1;
        }
        *slot = last.is_some_and(|last| last + radius >= index);
    }
}

#[cfg(test)]
pub(super) fn drawn(rows: &[&str]) -> Mask {
    let mut mask = Mask::new(rows[0].len(), rows.len());
    for (cell, letter) in rows.concat().chars().enumerate() {
        mask.set(cell, letter == '#');
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_close_holes_fill_and_pieces_part() {
        let mask = drawn(&[
            ".........",
            ".........",
            "..##.##..",
            "..##.##..",
            "..##.##..",
            ".........",
            ".........",
        ]);
        assert_eq!(mask.components(1).len(), 2);
        let closed = mask.closed(1);
        assert_eq!(closed.components(1).len(), 1);
        assert_eq!(closed.count(), 15);
        assert_eq!(closed.opened(1).count(), 15);
        assert_eq!(mask.opened(1).count(), 0);
        let ring = drawn(&[".....", ".###.", ".#.#.", ".###.", "....."]);
        assert_eq!(ring.with_holes_filled().count(), 9);
        assert_eq!(ring.with_holes_filled().largest_disc(), 1.5);
        assert_eq!(ring.dilated(1).count(), 25);
    }
}
