// `rtsg replay` as a test: runs the scene again on the log's input, compares pictures and sound with references, and
// writes the results as a page and as JUnit XML.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/session/replay_tests.h>

#include "output_arguments.h"

namespace rtsg::app {

struct ReplayTestArguments : ReplayTestOptions {
    void addTo(Command& command);
    bool any() const {
        return update || compared.any() || !rerun.empty() || !expectPicture.empty() || !expectSound.empty() ||
               !junit.empty() || !page.empty();
    }
};

/// --field, --ignore and --tolerance.
void addFieldSelection(Command& command, FieldSelection& selection);
/// Warns of the patterns that FieldComparison::ignoredInVain() names.
void warnOf(const std::vector<std::string>& ignoredInVain);
/// Throws UsageError.
void check(const FieldSelection& selection);

/// Returns the exit status. Throws UsageError for options that exclude each other.
int runReplayTestVerb(const std::string& log, const ReplayTestArguments& arguments, OutputArguments outputs, bool json);

/// {"frame":…,"t":…,"node":…,"field":…,"text":…} or null.
std::string toJson(const std::optional<Divergence>& divergence);
/// Warns of damage in two logs that were compared, although no state is missing because of it.
void warnOfDamage(const std::string& a, const std::string& b, const std::array<std::string, 2>& damage);
/// "compared":…,"in_one_alone":…,"damage":[…,…]: members of an object.
std::string toJson(const ComparedStates& states);
/// "damage":[…,…]
std::string toJson(const std::array<std::string, 2>& damage);

}  // namespace rtsg::app
