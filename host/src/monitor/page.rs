//! The files of the page, embedded in the program. [uPlot](https://github.com/leeoniya/uPlot) draws the curves; it is MIT-licensed,
//! see `page/uplot.LICENSE`. Look, ticks and number formats are those of the report page.

/// A file of the page.
#[derive(Clone, Copy, Debug)]
pub(super) struct PageFile {
    /// Its path in the address.
    pub(super) path: &'static str,
    /// Its media type.
    pub(super) kind: &'static str,
    /// Its text.
    pub(super) text: &'static str,
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const TEXT: &str = "text/plain; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

macro_rules! file {
    ($path:literal, $kind:expr, $file:literal) => {
        PageFile { path: $path, kind: $kind, text: include_str!($file) }
    };
}

/// All files.
pub(super) static FILES: &[PageFile] = &[
    file!("/", HTML, "page/index.html"),
    file!("/look.css", CSS, "../report/look.css"),
    file!("/monitor.css", CSS, "page/monitor.css"),
    file!("/uplot.css", CSS, "page/uplot.css"),
    file!("/uplot.js", SCRIPT, "page/uplot.js"),
    file!("/uplot.LICENSE", TEXT, "page/uplot.LICENSE"),
    file!("/axis.js", SCRIPT, "../report/script/axis.js"),
    file!("/connection.js", SCRIPT, "page/connection.js"),
    file!("/controls.js", SCRIPT, "page/controls.js"),
    file!("/curves.js", SCRIPT, "page/curves.js"),
    file!("/decimate.js", SCRIPT, "page/decimate.js"),
    file!("/histories.js", SCRIPT, "page/histories.js"),
    file!("/large.js", SCRIPT, "page/large.js"),
    file!("/main.js", SCRIPT, "page/main.js"),
    file!("/messages.js", SCRIPT, "page/messages.js"),
    file!("/model.js", SCRIPT, "page/model.js"),
    file!("/phase.js", SCRIPT, "page/phase.js"),
    file!("/plot.js", SCRIPT, "page/plot.js"),
    file!("/ring.js", SCRIPT, "page/ring.js"),
    file!("/save.js", SCRIPT, "page/save.js"),
    file!("/slow_plots.js", SCRIPT, "page/slow_plots.js"),
    file!("/spectrum.js", SCRIPT, "page/spectrum.js"),
    file!("/status.js", SCRIPT, "page/status.js"),
    file!("/text.js", SCRIPT, "../report/script/text.js"),
    file!("/theme.js", SCRIPT, "page/theme.js"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_needs_only_its_own_files_and_is_small() {
        let bytes: usize = FILES.iter().map(|file| file.text.len()).sum();
        assert!(bytes < 500 * 1024, "{bytes} bytes");
        let page = FILES[0].text;
        for part in page.split(['"', '\'']).filter(|part| part.ends_with(".js") || part.ends_with(".css")) {
            let path = format!("/{}", part.trim_start_matches(['.', '/']));
            assert!(FILES.iter().any(|file| file.path == path), "{part}");
        }
        for file in FILES.iter().filter(|file| file.kind == SCRIPT && file.path != "/uplot.js") {
            for line in file.text.lines().filter(|line| line.starts_with("import ") || line.starts_with("} from ")) {
                let imported = line.split(['"', '\'']).nth(1).unwrap_or_default();
                let path = format!("/{}", imported.trim_start_matches(['.', '/']));
                assert!(FILES.iter().any(|file| file.path == path), "{}: {line}", file.path);
            }
        }
    }
}
