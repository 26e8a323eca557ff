//! The script of the pages: values under the pointer, zoom and hidden curves of figures. It is within the page, which runs no other.

use std::sync::LazyLock;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest, Sha256};

/// The modules, each after those that it imports. The first two are also the live page's.
const MODULES: [&str; 3] =
    [include_str!("../script/axis.js"), include_str!("../script/text.js"), include_str!("../script/figures.js")];

/// The modules as one text, without their imports and exports.
pub(super) static SCRIPT: LazyLock<String> = LazyLock::new(|| {
    let lines = MODULES.iter().flat_map(|module| module.lines()).filter(|line| !line.starts_with("import "));
    lines.map(|line| line.strip_prefix("export ").unwrap_or(line).to_string() + "\n").collect()
});

/// The source of scripts in the page's security policy: this script by its digest, and no other.
pub(super) fn source() -> String {
    format!("'sha256-{}'", STANDARD.encode(Sha256::digest(SCRIPT.as_bytes())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::shown;

    #[test]
    fn the_script_is_the_same_on_the_page_as_in_its_digest() {
        assert_eq!(shown(&SCRIPT), *SCRIPT);
        assert!(!SCRIPT.contains("</") && !SCRIPT.contains('\r'));
    }

    #[test]
    fn no_name_of_the_script_is_declared_twice() {
        let declared = SCRIPT.lines().filter_map(|line| {
            let mut words = line.split([' ', '(', '=']);
            let kind = words.next().filter(|word| ["const", "let", "class", "function"].contains(word));
            kind.and(words.next())
        });
        let mut names: Vec<&str> = declared.collect();
        assert!(names.len() > 20, "{names:?}");
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
    }

    #[test]
    fn the_script_fetches_nothing_and_has_no_module_left_out() {
        for word in ["import", "export", "fetch(", "XMLHttpRequest", "WebSocket", "eval(", "innerHTML", "https:"] {
            assert!(!SCRIPT.contains(word), "{word}");
        }
        for module in MODULES {
            for line in module.lines().filter(|line| line.starts_with("import ")) {
                let names = line.split(['{', '}']).nth(1).expect("names");
                for name in names.split(',').map(str::trim) {
                    let known =
                        ["const", "function", "class"].iter().any(|kind| SCRIPT.contains(&format!("{kind} {name}")));
                    assert!(known, "{name}");
                }
            }
        }
    }
}
