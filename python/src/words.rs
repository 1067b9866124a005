//! What the crate says to those who run its program, said to those who call it from Python.

/// `text` with arguments and options of Python in place of flags.
pub(crate) fn in_python(text: &str) -> String {
    let mut parts = text.split("--");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let end = part.find(|c: char| !c.is_ascii_lowercase() && c != '-').unwrap_or(part.len());
        let (flag, rest) = part.split_at(end);
        match flag {
            // Behind it stands the key.
            "set" => {
                let rest = rest.trim_start();
                let end = rest
                    .find(|c: char| !c.is_ascii_lowercase() && c != '-' && c != '.')
                    .unwrap_or(rest.len());
                let (key, rest) = rest.split_at(end);
                out += &format!("options[\"{key}\"]{rest}");
            }
            "memory" => out += &format!("options[\"memory\"]{rest}"),
            _ => {
                out += &flag.replace('-', "_");
                out += rest;
            }
        }
    }
    out.replace("backend cpu", "device=\"cpu\"")
}
