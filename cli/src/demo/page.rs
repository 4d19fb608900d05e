//! The contact sheet: one page that shows and explains the pictures.

use std::io::Write;
use std::path::Path;

use relumine::radiometry::Difference;
use relumine::radiometry::files::write_atomically;

use super::pictures::{FOLDER, Figures};
use crate::failure::Failure;

/// Its file, the last that is written: where it is, everything is.
pub(super) const NAME: &str = "index.html";

const HEAD: &str = r#"<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Relumine: one object, photographed once, under any light</title>
<style>
  body { margin: 0 auto; max-width: 64rem; padding: 1rem; background: #161616; color: #ddd; font: 1rem/1.5 system-ui, sans-serif }
  h1 { font-size: 1.5rem } h2 { font-size: 1.2rem; margin-top: 2.5rem }
  .row { display: grid; gap: .75rem; grid-template-columns: repeat(auto-fit, minmax(15rem, 1fr)) }
  figure { margin: 0 } img { width: 100%; background: #000; image-rendering: auto }
  img.mosaic { image-rendering: pixelated }
  figcaption, small { color: #aaa; font-size: .85rem } a { color: #9cf }
  code, pre { background: #222; padding: .1rem .3rem; overflow-x: auto }
</style>
<h1>One object, photographed once, under any light</h1>
<p>A virtual projector stood at 16 × 4 places on a hemisphere round this board and threw patterns of 14 × 14 squares on it;
a virtual camera photographed them with noise, two exposures and 8 bits (<a href="rig.toml">rig.toml</a>). From these
photographs alone came the reflectance field, and from the field every picture here called <em>relit</em>. The
<em>truth</em> is the same board rendered directly under the same light by a path tracer. The figures are those of P. Peers,
V. Masselus, P. Dutré, Y. D. Willems, <cite>Relighting with 4D Incident Light Fields</cite> (2003), on an object of our own.</p>
"#;

const TAIL: &str = r#"<h2>Go on</h2>
<p>Everything lies beside this page. Change a light and look again:</p>
<pre>relumine relight chess.field --light spots.toml -o spots.png --exposure 0.8
relumine render scene.toml --light spots.toml -o truth.png --exposure 0.8
relumine light shafts.toml --for chess.field -o shafts-mosaic.exr
relumine inspect capture
relumine inspect chess.field</pre>
</html>
"#;

/// Writes the page.
pub(super) fn write(path: &Path, figures: &[Figures]) -> Result<(), Failure> {
    let text = [HEAD.to_string(), spots(figures), mosaic(), shafts(figures), moved(figures), TAIL.to_string()].concat();
    write_atomically(path, |file| file.write_all(text.as_bytes()))?;
    Ok(())
}

fn of<'a>(figures: &'a [Figures], name: &str) -> Option<&'a Figures> {
    figures.iter().find(|figures| figures.name == name)
}

fn figure(file: &str, class: &str, caption: &str) -> String {
    format!(
        "<figure><img class=\"{class}\" src=\"{FOLDER}/{file}.png\" alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>\n"
    )
}

fn off(difference: Option<&Difference>) -> String {
    difference.map_or(String::new(), |d| {
        format!(" ({:.0} % off in relative L2, ratio of means {:.3})", 100.0 * d.relative_l2, d.ratio_of_means)
    })
}

/// Relit, light map and truth of one light.
fn three(figures: &[Figures], name: &str) -> String {
    let found = of(figures, name);
    let relit = format!("relit as a light field{}", off(found.map(|figures| &figures.relit)));
    let map = format!("the same light as a light map{}", off(found.and_then(|figures| figures.light_map.as_ref())));
    [
        "<div class=\"row\">\n".to_string(),
        figure(name, "", &relit),
        figure(&format!("{name}-light-map"), "", &map),
        figure(&format!("{name}-truth"), "", "truth"),
        "</div>\n".to_string(),
    ]
    .concat()
}

fn spots(figures: &[Figures]) -> String {
    let text = "<h2>Two spot lights (figure 1)</h2>\n<p>A warm spot on the king, a cold one from the right; both shine \
                on the centre of the board. A light map, which is all that an environment map can be, says only what arrives \
                there, and must light every other place alike: its spots are two suns. The lamps stand where the projector \
                once stood, so their rims are as sharp as its squares, 13 cm on the board. \
                <a href=\"spots.toml\">spots.toml</a></p>\n";
    text.to_string() + &three(figures, "spots")
}

fn mosaic() -> String {
    let text = "<h2>The light on the cells (figure 9)</h2>\n<p>A lamp near the board and a shaft of bluish light (\
                <a href=\"moved-1.toml\">moved-1.toml</a>) as the field sees them: a square for each place of the projector, \
                azimuth to the right and tilt downward from the zenith, in it a pixel for each square of the pattern. The \
                lamp is seen from many places, in another square from each: that is what a light map cannot say. The shaft \
                shines from one place and its neighbours.</p>\n";
    format!("{text}{}", figure("mosaic", "mosaic", "16 × 4 positions, 14 × 14 squares each"))
}

fn shafts(figures: &[Figures]) -> String {
    let text = "<h2>Three coloured shafts (figure 10)</h2>\n<p>Parallel light through three holes. As a light map the shafts \
                become three suns that shine on everything. <a href=\"shafts.toml\">shafts.toml</a></p>\n";
    text.to_string() + &three(figures, "shafts")
}

fn moved(figures: &[Figures]) -> String {
    let mut text = String::from(
        "<h2>The board moved in the light (figure 11)</h2>\n<p>A lamp at the left and a shaft of bluish light stay where they \
         are; the board is moved, and turned, within them: top relit, bottom the truth. Here the light comes from between the \
         places of the projector, so it is shared by its neighbours and edges are softer and doubled; more places would \
         sharpen them. <a href=\"moved-1.toml\">moved-1.toml</a>, <a href=\"moved-2.toml\">moved-2.toml</a>, \
         <a href=\"moved-3.toml\">moved-3.toml</a></p>\n<div class=\"row\">\n",
    );
    let places = ["moved-1", "moved-2", "moved-3"];
    for name in places {
        let relit = format!("relit{}", off(of(figures, name).map(|figures| &figures.relit)));
        text += &figure(name, "", &relit);
    }
    text += "</div>\n<div class=\"row\">\n";
    for name in places {
        text += &figure(&format!("{name}-truth"), "", "truth");
    }
    text + "</div>\n"
}
