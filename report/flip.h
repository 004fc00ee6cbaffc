// ꟻLIP: how strongly an observer who flips between two pictures sees them differ (Andersson, Nilsson, Akenine-Möller,
// Oskarsson, Åström and Fairchild 2020, "FLIP: a difference evaluator for alternating images"; with the filters of
// their code). 0: no difference, 1: the largest that the colours of a display allow.
//
// The text is our own: no Debian package has it, and OpenImageIO 2.4's compare_Yee, the other candidate, reads the
// second channel of luminance pictures that have one, so that it calls black and white alike.
#pragma once

#include <span>
#include <vector>

namespace lobefit {

/// Errors [y][x] of two linear Rec.709 pictures [y][x][channel] as a display shows them, cut to 0…1, seen at so many
/// pixels per degree.
std::vector<double> flip_errors(std::span<const float> a, std::span<const float> b, int width, int height,
                                double pixels_per_degree);

}  // namespace lobefit
