//! Pages inside a notebook.

/// A whole page as one element of another: a frame of its own, so that neither's styles reach the other. Nothing in it runs.
pub(crate) fn framed(html: &str) -> String {
    let escaped = html.replace('&', "&amp;").replace('"', "&quot;");
    format!(
        "<iframe sandbox=\"\" style=\"width:100%;height:45rem;border:1px solid #ccc;resize:vertical\" srcdoc=\"{escaped}\"></iframe>"
    )
}
