// Many fits into one folder: one progress bar, one summary.
#pragma once

#include <filesystem>

#include "cli/fit_job.h"

namespace lobefit {

/// Fits every source in parallel and writes NAME.fit.json for each, then summary.csv, .json and .md. Sources that fail
/// are listed there and stop nothing. `resume` keeps fits that the folder holds from the same command and file. Throws
/// Error(usage) where two sources have one name or a fit is there already, Error(not_converged) at the end if a fit did
/// not converge, Error(invalid_input) if every source failed.
void run_fit_batch(const FitJobSettings& settings, const std::vector<FitSource>& sources,
                   const std::filesystem::path& folder, bool resume, const Context& context);

}  // namespace lobefit
