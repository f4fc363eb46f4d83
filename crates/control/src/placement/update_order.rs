//! The order in which the method of Tits and Yang improves pairs of eigenvectors.

/// Pairs of columns, from 0, for one sweep over `n` columns, the first `reals` of which belong to real
/// eigenvalues in ascending order and the others to conjugate pairs.
///
/// Each real eigenvalue is combined with all other real ones; the conjugate pairs are repeated after each group of
/// these combinations. A single real eigenvalue gives (0, 0).
///
/// Source: A. L. Tits and Y. Yang (see [`super::place`]), page 1442, as scipy reads it.
pub(crate) fn update_order(reals: usize, n: usize) -> Vec<(usize, usize)> {
    let (half, odd) = (reals / 2, reals % 2);
    let mut order = vec![];
    let pairs = |order: &mut Vec<(usize, usize)>| {
        order.extend((reals + 1..=n).step_by(2).map(|column| (column, column + 1)));
    };
    let single_and_pairs = |order: &mut Vec<(usize, usize)>| {
        if reals == 1 {
            order.push((1, 1));
        }
        pairs(order);
    };
    if reals > 0 {
        order.push((reals, 1));
    }
    order.extend((1..half + odd).map(|k| (2 * k, 2 * k + 1)));
    pairs(&mut order);
    order.extend((1..=half).map(|k| (2 * k - 1, 2 * k)));
    single_and_pairs(&mut order);
    for distance in 2..half + odd {
        order.extend((1..=half).map(|k| (k, k + distance)));
    }
    single_and_pairs(&mut order);
    for distance in 2..half + odd {
        let wrapped = |k: usize| if k > reals { k - reals } else { k };
        order.extend((half + 1..=reals).map(|k| (k, wrapped(k + distance))));
    }
    single_and_pairs(&mut order);
    order.extend((1..=half).map(|k| (k, k + half)));
    single_and_pairs(&mut order);
    order.into_iter().map(|(i, j)| (i - 1, j - 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::update_order;

    /// The expected orders are the output of scipy 1.17.
    #[test]
    fn the_order_is_that_of_scipy() {
        let with_a_pair = [
            [(4, 0), (1, 2), (3, 4), (5, 6)].as_slice(),
            &[(0, 1), (2, 3), (5, 6), (0, 2), (1, 3), (5, 6)],
            &[(2, 4), (3, 0), (4, 1), (5, 6), (0, 2), (1, 3), (5, 6)],
        ];
        assert_eq!(update_order(5, 7), with_a_pair.concat());
        assert_eq!(update_order(4, 4), [(3, 0), (1, 2), (0, 1), (2, 3), (0, 2), (1, 3)]);
        assert_eq!(update_order(1, 5), [(0, 0), (1, 2), (3, 4)].repeat(5));
        assert_eq!(update_order(0, 4), [(0, 1), (2, 3)].repeat(5));
    }
}
