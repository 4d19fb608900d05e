//! A corner of a face: `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 1, or from −1 backwards.

use crate::models::file::short;

/// Indices of place, texture coordinates and normal, counted from 0, each below its count; only a place must be there.
pub(super) fn corner(text: &str, counts: [usize; 3]) -> Result<[Option<usize>; 3], String> {
    let mut indices = [None; 3];
    let mut words = text.split('/');
    for ((index, count), (word, what)) in indices.iter_mut().zip(counts).zip(words.by_ref().zip(["v", "vt", "vn"])) {
        if !word.is_empty() {
            *index = Some(one(word, what, count)?);
        }
    }
    if words.next().is_some() || indices[0].is_none() {
        return Err(format!("a corner v, v/vt, v//vn or v/vt/vn was expected, found {:?}", short(text)));
    }
    Ok(indices)
}

fn one(word: &str, what: &str, count: usize) -> Result<usize, String> {
    let index = word.parse::<i64>().ok().and_then(|number| match number {
        1.. => usize::try_from(number - 1).ok(),
        0 => None,
        _ => count.checked_sub(usize::try_from(number.unsigned_abs()).ok()?),
    });
    index.filter(|index| *index < count).ok_or_else(|| {
        format!("an index of {what} from 1 to {count} or from -1 to -{count} was expected, found {:?}", short(word))
    })
}

#[cfg(test)]
mod tests {
    use super::corner;

    #[test]
    fn corners_count_from_either_end() {
        let counts = [4, 3, 2];
        assert_eq!(corner("1", counts), Ok([Some(0), None, None]));
        assert_eq!(corner("4/3", counts), Ok([Some(3), Some(2), None]));
        assert_eq!(corner("-4//-1", counts), Ok([Some(0), None, Some(1)]));
        assert_eq!(corner("2/-3/1", counts), Ok([Some(1), Some(0), Some(0)]));
        for text in ["0", "5", "-5", "1/4", "1//3", "", "/1", "1/1/1/1", "x", "1.5", "-9223372036854775808"] {
            assert!(corner(text, counts).is_err(), "{text:?}");
        }
    }
}
