//! Fixes to the last bit.

use surefix::Fix;

/// All numbers of a fix: `0` and `-0` differ.
pub(crate) fn bits(fix: &Fix) -> [u64; 28] {
    let one = |bits: u64| bits.wrapping_add(1);
    let Fix { frame, trusted, blank, place, segment, segment_place, score, .. } = *fix;
    let short = |x: f32| u64::from(x.to_bits());
    let mut all = [0; 28];
    let head = [frame, u64::from(trusted), u64::from(blank), place as u64, segment as u64];
    all[..5].copy_from_slice(&head);
    all[5..7].copy_from_slice(&[segment_place as u64, short(score)]);
    all[7..9].copy_from_slice(&[fix.single.place as u64, short(fix.single.distance)]);
    all[9..11].copy_from_slice(&[fix.gradient.place as u64, short(fix.gradient.value)]);
    if let Some(s) = fix.sequence {
        let each = [s.place as u64, short(s.score), s.anchors as u64, s.speed.to_bits()];
        all[11..15].copy_from_slice(&each);
        all[15] = 1;
    }
    if let Some(t) = fix.track {
        let (low, high) = t.interval;
        let each = [t.place as u64, low as u64, high as u64, t.confidence.to_bits()];
        all[16..20].copy_from_slice(&each);
        all[20..22].copy_from_slice(&[t.off_map.to_bits(), t.speed.to_bits()]);
        all[22] = 1;
    }
    all[23] = fix.accepted.map_or(0, |accepted| 1 + u64::from(accepted));
    all[24] = fix.probability.map_or(0, |probability| one(probability.to_bits()));
    all
}
