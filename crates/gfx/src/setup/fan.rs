//! The triangles of a clipped polygon.

use super::{ScreenVertex, signed_area};
use crate::clip::MAX_VERTICES;

/// Cuts a clipped polygon's snapped vertices into triangles without area in common: index triples in the polygon's winding.
///
/// They are a fan about the first vertex, unless snapping has bent a nearly straight corner inwards. A fan's triangle there
/// turns over, and leaving it out would have its neighbour reach beyond the outline, where another primitive may be. Such a
/// polygon is cut ear by ear, so that what is covered is the inside of the snapped outline, no more and no less.
pub fn fan(v: &[ScreenVertex]) -> impl Iterator<Item = [usize; 3]> + use<> {
    let v = &v[..v.len().min(MAX_VERTICES)];
    let mut triples = Triples { list: [[0; 3]; MAX_VERTICES], len: 0 };
    let fan = || (2..v.len()).map(|i| [0, i - 1, i]);
    let area = |[a, b, c]: [usize; 3]| signed_area(&[v[a], v[b], v[c]]);
    let sign = fan().map(area).sum::<i64>().signum();
    if sign == 0 {
        return triples.list.into_iter().take(0);
    }
    if fan().all(|t| area(t) * sign >= 0) {
        fan().filter(|&t| area(t) != 0).for_each(|t| triples.push(t));
    } else {
        ears(v, sign, &mut triples);
    }
    triples.list.into_iter().take(triples.len)
}

struct Triples {
    list: [[usize; 3]; MAX_VERTICES],
    len: usize,
}

impl Triples {
    fn push(&mut self, triple: [usize; 3]) {
        self.list[self.len] = triple;
        self.len += 1;
    }
}

/// Cuts corner after corner off a polygon of the winding `sign`.
#[cold]
fn ears(v: &[ScreenVertex], sign: i64, out: &mut Triples) {
    let mut ring = [0; MAX_VERTICES];
    let mut n = v.len();
    (0..n).for_each(|i| ring[i] = i);
    let area = |[a, b, c]: [usize; 3]| signed_area(&[v[a], v[b], v[c]]) * sign;
    while n >= 3 {
        let corner = |i: usize| [ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]];
        // Nothing of the outline may lie behind the cut.
        let free = |[a, b, c]: [usize; 3]| {
            ring[..n].iter().all(|&p| area([a, b, p]) <= 0 || area([b, c, p]) <= 0 || area([c, a, p]) < 0)
        };
        let flat = (0..n).find(|&i| area(corner(i)) == 0);
        let ear = flat.or_else(|| (0..n).find(|&i| area(corner(i)) > 0 && free(corner(i))));
        // An outline that crosses itself, which only one of no width to speak of does, has corners but may have no ear.
        let Some(i) = ear.or_else(|| (0..n).find(|&i| area(corner(i)) > 0)) else { return };
        if flat.is_none() {
            out.push(corner(i));
        }
        ring.copy_within(i + 1..n, i);
        n -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The signed area of an outline, twice.
    fn outline(v: &[ScreenVertex]) -> i64 {
        (2..v.len()).map(|i| signed_area(&[v[0], v[i - 1], v[i]])).sum()
    }

    fn polygon(points: &[[i32; 2]]) -> Vec<ScreenVertex> {
        points.iter().map(|&[x, y]| ScreenVertex { x, y, ..ScreenVertex::default() }).collect()
    }

    #[test]
    fn a_convex_polygon_is_a_fan() {
        let v = polygon(&[[0, 0], [100, 0], [120, 50], [60, 90], [0, 80]]);
        assert!(fan(&v).eq([[0, 1, 2], [0, 2, 3], [0, 3, 4]]));
        // A corner that is straight belongs to a triangle without area.
        let v = polygon(&[[0, 0], [50, 0], [100, 0], [100, 100]]);
        assert!(fan(&v).eq([[0, 2, 3]]));
    }

    #[test]
    fn a_corner_bent_inwards_is_cut_around() {
        // Of either winding, and whichever vertex comes first.
        for turn in 0..5 {
            for mirror in [1, -1] {
                let mut points = [[0, 0], [100, 0], [60, 3], [100, 90], [0, 80]].map(|[x, y]| [x * mirror, y]);
                points.rotate_left(turn);
                let v = polygon(&points);
                let triples: Vec<_> = fan(&v).collect();
                let area = |t: &[usize; 3]| signed_area(&t.map(|i| v[i]));
                assert!(triples.iter().all(|t| area(t).signum() == outline(&v).signum()), "{turn} {mirror}: {triples:?}");
                assert_eq!(triples.iter().map(area).sum::<i64>(), outline(&v), "{turn} {mirror}: {triples:?}");
            }
        }
    }

    #[test]
    fn outlines_without_width_end() {
        for points in [vec![[0, 0]; 7], vec![[0, 0], [10, 0], [5, 0], [12, 0], [1, 0]], vec![[0, 0], [9, 9], [9, 0], [0, 9]]] {
            assert!(fan(&polygon(&points)).count() < 4, "{points:?}");
        }
        assert_eq!(fan(&[]).count(), 0);
    }
}
