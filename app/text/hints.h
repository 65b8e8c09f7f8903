// Hints for users of other programs: the verbs, options and endpoints here that correspond to those they typed.
// Threading: none of its own.
#pragma once

#include <string>
#include <vector>

namespace rtsg::app {

/// The command that replaces a first word that is no verb: "rtsg mirror ENDPOINT" for connect. Empty if unknown.
std::string hintForVerb(const std::string& word);
/// The option that replaces one that the verb lacks: one of `known`, or for example "--size 1280x720" for --width.
/// Empty if unknown.
std::string hintForOption(const std::string& typed, const std::vector<std::string>& known);
/// The endpoint that was probably meant: tcp://127.0.0.1:5570 for localhost:5570; for a scene file, the verb that
/// serves it. Empty if unknown.
std::string hintForEndpoint(const std::string& typed);

/// Throws UsageError, with the hint, if this is no endpoint.
void checkEndpoint(const std::string& option, const std::string& endpoint);

}  // namespace rtsg::app
