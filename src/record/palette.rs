//! One colour for each agent, the same in every picture of the workbench.

/// The colour of an agent, told apart by people with any colour vision as far as 8 colours allow; agents 8–15 wear lighter
/// and agents 16–23 darker tints of the same, then they repeat.
#[must_use]
pub fn agent_color(agent: u32) -> [u8; 3] {
    let base = BASE[agent as usize % BASE.len()];
    match (agent as usize / BASE.len()) % 3 {
        0 => base,
        1 => base.map(|channel| channel / 2 + 127),
        _ => base.map(|channel| (u16::from(channel) * 3 / 5) as u8),
    }
}

/// After Okabe and Ito, "Color Universal Design"; black is left out and blue raised, for dark backgrounds.
const BASE: [[u8; 3]; 8] = [
    [230, 159, 0],
    [86, 180, 233],
    [0, 170, 125],
    [240, 228, 66],
    [90, 120, 235],
    [225, 95, 20],
    [214, 130, 180],
    [170, 170, 170],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_four_agents_have_twenty_four_colors() {
        let mut colors: Vec<_> = (0..24).map(agent_color).collect();
        colors.sort_unstable();
        colors.dedup();
        assert_eq!(colors.len(), 24);
    }

    #[test]
    fn tints_are_lighter_then_darker() {
        assert_eq!(agent_color(0), [230, 159, 0]);
        assert_eq!(agent_color(8), [242, 206, 127]);
        assert_eq!(agent_color(16), [138, 95, 0]);
        assert_eq!(agent_color(24), agent_color(0));
    }
}
