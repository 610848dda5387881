//! Finds the block at which a program continues: the other branch, the end of a loop, a label.

use super::block::{Block, Direction, Statement};

/// The block after the `ELSE` (when it counts) or `ENDIF` that belongs to the `IF` or `ELSE` at a block.
pub(super) fn after_branch(blocks: &[Block], at: usize, to_else: bool) -> Option<usize> {
    let mut depth = 0;
    for (index, block) in blocks.iter().enumerate().skip(at + 1) {
        match block.statements.first() {
            Some(Statement::If(_)) => depth += 1,
            Some(Statement::Else) if depth == 0 && to_else => return Some(index + 1),
            Some(Statement::EndIf) if depth == 0 => return Some(index + 1),
            Some(Statement::EndIf) => depth -= 1,
            _ => {}
        }
    }
    None
}

pub(super) fn begins_loop(block: &Block) -> bool {
    matches!(block.statements.first(), Some(Statement::While(_)))
}

/// The block of the `ENDWHILE` that belongs to the `WHILE` at a block.
pub(super) fn end_of_loop(blocks: &[Block], at: usize) -> Option<usize> {
    let mut depth = 0;
    for (index, block) in blocks.iter().enumerate().skip(at + 1) {
        match block.statements.first() {
            Some(Statement::While(_)) => depth += 1,
            Some(Statement::EndWhile) if depth == 0 => return Some(index),
            Some(Statement::EndWhile) => depth -= 1,
            _ => {}
        }
    }
    None
}

pub(super) fn find_label(
    blocks: &[Block],
    at: usize,
    direction: Direction,
    label: &str,
) -> Option<usize> {
    let is = |index: &usize| blocks[*index].label.as_deref() == Some(label);
    let after = || (at + 1..blocks.len()).find(is);
    let before = || (0..=at).rev().find(is);
    match direction {
        Direction::Forward => after(),
        Direction::Back => before(),
        Direction::Anywhere => after().or_else(before),
    }
}
