//! The HTML of the page.

use maud::{DOCTYPE, PreEscaped, html};

use crate::text::{html_page, json_in_script};

const STYLE: &str = include_str!("page/style.css");

/// The page's code: one script, in this order.
const SCRIPTS: [&str; 12] = [
    include_str!("page/decode.js"),
    include_str!("page/selection.js"),
    include_str!("page/raster.js"),
    include_str!("page/brushes.js"),
    include_str!("page/panel.js"),
    include_str!("page/scatter.js"),
    include_str!("page/scene.js"),
    include_str!("page/player.js"),
    include_str!("page/ranges.js"),
    include_str!("page/legend.js"),
    include_str!("page/share.js"),
    include_str!("page/main.js"),
];

/// The page with this data, as JSON.
pub(super) fn page(title: &str, data: &str) -> String {
    let data = json_in_script(data);
    html_page(html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) " – visited states" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                (PreEscaped(include_str!("page/body.html")))
                script type="application/json" id="data" { (PreEscaped(data)) }
                script { (PreEscaped(SCRIPTS.join("\n"))) }
            }
        }
    })
}
