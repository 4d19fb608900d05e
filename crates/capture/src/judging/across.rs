//! What all positions together show: a camera that moved between them, and a black frame that is brighter than elsewhere.

use super::{Finding, FindingKind, Judge, PositionJudgement, Severity};
use crate::ShownPattern;

/// Pixels of a picture reduced to [`super::registration::DETAIL`] that a position must be shifted by.
const MOVED: f64 = 0.75;
/// References that must be seen before a position is judged.
const LEAST_SEEN: usize = 2;
/// A black frame must be brighter than the median by this factor and by this share of white.
const BRIGHTER: (f64, f64) = (1.5, 0.002);
/// No projector shows a black as bright as this share of its white.
const AMBIENT: f64 = 0.03;

pub(super) fn judge(judge: &Judge, judgements: &[PositionJudgement]) -> Vec<Finding> {
    let mut findings = moved(judge, judgements);
    findings.extend(bright_black(judge, judgements));
    findings.sort_by_key(|finding| finding.position);
    findings
}

fn finding(
    judge: &Judge,
    (kind, severity, position, pattern): (FindingKind, Severity, usize, ShownPattern),
    (measured, expected): (f64, f64),
    text: String,
) -> Finding {
    let files = judge.capture().exposures(position, pattern).iter().map(|row| row.file.clone()).collect();
    Finding { kind, severity, position, patterns: vec![pattern], files, measured, expected, text }
}

/// Each position is registered against a few, which may have moved themselves: where a position stands is the median over all
/// references, each corrected by where it stands among them.
fn moved(judge: &Judge, judgements: &[PositionJudgement]) -> Vec<Finding> {
    let references = judge.references();
    let shifts_of = |position: usize| {
        judgements.iter().find(|judgement| judgement.position == position).map(|judgement| &judgement.shifts)
    };
    let others = |position: usize, offsets: &[(f64, f64)]| -> Vec<(f64, f64)> {
        let Some(shifts) = shifts_of(position) else { return Vec::new() };
        let seen = references.iter().zip(shifts).zip(offsets).filter(|((reference, _), _)| **reference != position);
        seen.filter_map(|((_, shift), offset)| shift.map(|(dx, dy)| (dx + offset.0, dy + offset.1))).collect()
    };
    let still = vec![(0.0, 0.0); references.len()];
    // With few references one of them that moved moves all others as much: the rest of the capture outvotes it.
    let offset = |index: usize| -> (f64, f64) {
        let against: Vec<(f64, f64)> = judgements
            .iter()
            .filter(|judgement| judgement.position != references[index])
            .filter_map(|judgement| judgement.shifts[index].map(|(dx, dy)| (-dx, -dy)))
            .collect();
        median2(&against).unwrap_or_default()
    };
    let offsets: Vec<(f64, f64)> = (0..still.len()).map(offset).collect();
    let block = judge.detail.block as f64;
    let mut findings = Vec::new();
    for judgement in judgements {
        let seen = others(judgement.position, &offsets);
        if seen.len() < LEAST_SEEN {
            continue;
        }
        let Some((dx, dy)) = median2(&seen) else { continue };
        if dx.hypot(dy) > MOVED * block {
            let text = format!(
                "the picture is shifted by ({dx:.1}, {dy:.1}) pixels against the other positions: the camera or the object moved"
            );
            let what = (FindingKind::CameraMoved, Severity::Fault, judgement.position, ShownPattern::White);
            findings.push(finding(judge, what, (dx.hypot(dy), MOVED * block), text));
        }
    }
    findings
}

/// Black frames that show more of white than elsewhere, so that the other photographs of the position agree with it: light that was on all
/// the time.
fn bright_black(judge: &Judge, judgements: &[PositionJudgement]) -> Vec<Finding> {
    let shares: Vec<f64> = judgements.iter().filter_map(|judgement| judgement.black_share).collect();
    let Some(usual) = median(shares) else { return Vec::new() };
    let mut findings = Vec::new();
    for judgement in judgements {
        let explained = judgement.findings.iter().any(|finding| {
            finding.patterns.iter().any(|pattern| matches!(pattern, ShownPattern::Black | ShownPattern::White))
                && finding.severity == Severity::Fault
        });
        let Some(share) = judgement.black_share.filter(|_| !explained) else { continue };
        let limit = (BRIGHTER.0 * usual).max(usual + BRIGHTER.1);
        let what = (FindingKind::BlackFrame, Severity::Warning, judgement.position, ShownPattern::Black);
        if share > limit {
            let text = format!(
                "black is {:.2} % of white here, {:.2} % at the other positions: was there other light?",
                100.0 * share,
                100.0 * usual
            );
            findings.push(finding(judge, what, (share, usual), text));
        } else if share > AMBIENT {
            let text = format!("black is {:.1} % of white: was there other light than the projector's?", 100.0 * share);
            findings.push(finding(judge, what, (share, AMBIENT), text));
        }
    }
    findings
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    values.sort_by(f64::total_cmp);
    Some(0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2]))
}

fn median2(values: &[(f64, f64)]) -> Option<(f64, f64)> {
    Some((median(values.iter().map(|value| value.0).collect())?, median(values.iter().map(|value| value.1).collect())?))
}
