//! What a URI of a buffer or a picture means (§2.8): bytes in itself, or a file beside the model.

/// Whether a URI holds its bytes in itself.
pub(super) fn is_data(uri: &str) -> bool {
    uri.starts_with("data:")
}

/// Bytes that a URI holds in itself, if it begins with `data:`.
///
/// # Errors
/// What was expected, in words.
pub(super) fn data(uri: &str) -> Option<Result<Vec<u8>, &'static str>> {
    let rest = uri.strip_prefix("data:")?;
    let Some((kind, payload)) = rest.split_once(',') else {
        return Some(Err("a comma was expected in the data: URI"));
    };
    Some(match kind.ends_with(";base64") {
        true => base64(payload.as_bytes()).ok_or("base64 (RFC 4648, §4) was expected in the data: URI"),
        false => percent_decoded(payload).ok_or("two hexadecimal digits were expected after % in the data: URI"),
    })
}

/// The path that a relative URI means.
pub(super) fn path(uri: &str) -> Option<String> {
    String::from_utf8(percent_decoded(uri)?).ok()
}

/// Without padding as well.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let text = text.strip_suffix(b"==").or_else(|| text.strip_suffix(b"=")).unwrap_or(text);
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 2);
    for letters in text.chunks(4) {
        let mut bits = 0;
        for letter in letters {
            let digit = match letter {
                b'A'..=b'Z' => letter - b'A',
                b'a'..=b'z' => letter - b'a' + 26,
                b'0'..=b'9' => letter - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return None,
            };
            bits = bits << 6 | u32::from(digit);
        }
        // Four letters are three bytes; three are two, two are one, and one is none.
        let whole = match letters.len() {
            4 => 3,
            3 => 2,
            2 => 1,
            _ => return None,
        };
        let aligned = bits << (6 * (4 - letters.len()));
        bytes.extend_from_slice(&aligned.to_be_bytes()[1..1 + whole]);
    }
    Some(bytes)
}

fn percent_decoded(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        rest = after;
        if *first != b'%' {
            bytes.push(*first);
            continue;
        }
        let digit = |at: usize| char::from(*after.get(at)?).to_digit(16);
        bytes.push((digit(0)? * 16 + digit(1)?) as u8);
        rest = &after[2..];
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        // RFC 4648, §10.
        for (text, bytes) in [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYmE", "fooba")] {
            assert_eq!(base64(text.as_bytes()).as_deref(), Some(bytes.as_bytes()), "{text}");
        }
        for text in ["Z", "Zm9vY", "Zm 9v", "Zg==Zg==", "===="] {
            assert_eq!(base64(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn percent_signs_are_letters_of_a_path() {
        assert_eq!(path("a%20b/%C3%A4.bin").as_deref(), Some("a b/ä.bin"));
        assert_eq!((path("a%2"), path("%zz"), path("%ff")), (None, None, None));
    }
}
