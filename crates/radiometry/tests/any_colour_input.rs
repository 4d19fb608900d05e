//! Any text gives a chart, reference values or a correction that can be used, or an error that names the file: never a panic.

use std::path::Path;

use proptest::prelude::*;
use relumine_radiometry::colour::{Chart, ColourProfile, Illuminant, Reference};

#[path = "../../../fuzz/spoil.rs"]
mod spoil;
use spoil::{seeded, spoiled_text};

const CHARTS: [&str; 2] = [
    "BOXES 25\n  F _ _ 10.0 9.75  321.25  9.75   321.26  217  10.0 217\n  D ALL ALL _ _ 330 228  0 0  0 0\n  \
     Y 1 6 A D  46.0 46.0    12.0  11.5  52.5  52.5\n\nBOX_SHRINK 6.0\n\nREF_ROTATION 0.0\n\nXLIST 2\n  12.0    1.0 1.0\n  \
     58.5    1.0 1.0\n\nEXPECTED XYZ 3\n  A1 11.773 10.213 4.9219\n  A2 40.174 36.201 20.217\n  D6 3.0110 3.0971 2.5475\n",
    "BOXES 12\n  X SAT SAT 1 8 10.0 10.0 13.5 102.1  0.0 -12.9\n  X A T 01 12 12.675 12.75 27.5 20.0 15.175 15.25\n\
     EXPECTED LAB 2\n SAT1 50 10 -20\n A12 96.5 0.1 0.2\n",
];

const TABLES: [&str; 2] = [
    "CTI2\n\nDESCRIPTOR \"a chart\"\nKEYWORD \"SAMPLE_LOC\"\nNUMBER_OF_FIELDS 8\nBEGIN_DATA_FORMAT\nSAMPLE_ID SAMPLE_LOC XYZ_X XYZ_Y XYZ_Z \
     RGB_R RGB_G RGB_B\nEND_DATA_FORMAT\nNUMBER_OF_SETS 2\nBEGIN_DATA\n1  \"A01\" 88.2480 87.5060 67.6240 99.2353 99.7118 99.5554\n\
     2  \"A02\" 0.794510 0.785690 0.624230 3.14714 4.68603 5.08608\nEND_DATA\n",
    "IT8.7/2\r\nNUMBER_OF_FIELDS 4\r\nBEGIN_DATA_FORMAT\r\nSAMPLE_ID LAB_L LAB_A LAB_B\r\nEND_DATA_FORMAT\r\nBEGIN_DATA\r\n\
     A01 37.99   13.56   14.06\r\nD06 20.46 -0.08 -0.97\r\nEND_DATA\r\n",
];

const PROFILES: [&str; 2] = [
    "format = \"relumine-colour/1\"\nmodel = \"matrix\"\ncoefficients = [[1.5, -0.4, -0.1], [-0.2, 1.3, -0.1], [0.1, -0.5, 1.4]]\n",
    "format = \"relumine-colour/1\"\nmodel = \"root-polynomial\"\ncoefficients = [[1.5, -0.2, 0.1, -0.3, 0.02, -0.1], [-0.1, 1.2, 0.05, \
     0.1, -0.2, 0.03], [0.02, -0.3, 1.4, 0.01, -0.1, -0.05]]\n[fitted]\nprogram = \"relumine\"\nphotograph = \"a.png\"\nresponse = \"srgb\"\n\
     chart = \"24\"\nreference = \"r\"\nilluminant = \"D50\"\ncorners = [[1, 2], [3, 4], [5, 6], [7, 8]]\nfound = true\nwhite_kept = false\n\
     exposure = 1.25\npatches = 23\nleft_out = [\"D1: clipped\"]\nbefore = { mean = 6.0, median = 5.0, max = 9.0, worst = \"A1\" }\n\
     after = { mean = 1.0, median = 0.5, max = 3.0, worst = \"A1\" }\nheld_out = { mean = 1.2, median = 0.7, max = 4.0, worst = \"B2\" }\n",
];

const ILLUMINANTS: [Illuminant; 5] =
    [Illuminant::D50, Illuminant::D65, Illuminant::C, Illuminant::A, Illuminant::LightestPatch];

#[test]
fn the_texts_are_whole_before_they_are_spoiled() {
    for text in CHARTS {
        assert!(Chart::parse_cht(Path::new("a.cht"), text).is_ok(), "{text}");
    }
    for text in CHARTS.into_iter().chain(TABLES) {
        assert!(Reference::parse(Path::new("a.cie"), text, Illuminant::D50).is_ok(), "{text}");
    }
    for text in PROFILES {
        let profile = ColourProfile::parse(Path::new("c.toml"), text).unwrap();
        let again = ColourProfile::parse(Path::new("c.toml"), &profile.to_text().unwrap()).unwrap();
        assert_eq!(profile, again, "there and back");
    }
}

proptest! {
    #![proptest_config(seeded(2000))]

    #[test]
    fn a_spoiled_chart_has_patches_with_names_or_says_what_is_wrong(text in spoiled_text(&CHARTS)) {
        match Chart::parse_cht(Path::new("a.cht"), &text) {
            Ok(chart) => {
                prop_assert!(!chart.patches().is_empty() && chart.patches().len() <= 10_000);
                for patch in chart.patches() {
                    prop_assert!(patch.rectangle.iter().all(|value| value.is_finite()) && (0.0..0.5).contains(&patch.margin));
                    prop_assert!(patch.rectangle[0] < patch.rectangle[2] && patch.rectangle[1] < patch.rectangle[3]);
                }
                if let Some([columns, rows]) = chart.grid() {
                    prop_assert_eq!(columns * rows, chart.patches().len());
                }
            }
            Err(error) => prop_assert!(error.to_string().starts_with("a.cht:"), "{}", error),
        }
    }

    #[test]
    fn spoiled_reference_values_are_finite_or_say_what_is_wrong(text in prop_oneof![spoiled_text(&TABLES), spoiled_text(&CHARTS)]) {
        for illuminant in ILLUMINANTS {
            match Reference::parse(Path::new("a.cie"), &text, illuminant) {
                Ok(reference) => {
                    prop_assert!(!reference.is_empty());
                    let (name, chroma) = reference.lightest().unwrap();
                    prop_assert!(chroma.is_finite() && reference.rec709(name).unwrap().iter().all(|value| value.is_finite()));
                }
                Err(error) => prop_assert!(error.to_string().starts_with("a.cie:"), "{}", error),
            }
        }
    }

    #[test]
    fn a_spoiled_profile_corrects_or_says_what_is_wrong(text in spoiled_text(&PROFILES)) {
        match ColourProfile::parse(Path::new("c.toml"), &text) {
            Ok(profile) => {
                prop_assert!(profile.correction.apply([0.5, 0.25, 1.0]).iter().all(|value| value.is_finite()));
                prop_assert!(profile.correction.matrix().is_none() || profile.correction.inverse().is_some());
            }
            Err(error) => prop_assert!(error.to_string().starts_with("c.toml"), "{}", error),
        }
    }
}
