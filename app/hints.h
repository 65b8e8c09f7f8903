// What people type who come from other programs, and what they may have meant: verbs, options and endpoints by other
// names. Threading: none of its own.
#pragma once

#include <string>
#include <vector>

namespace rtsg::app {

/// What to type in place of a first word that is no verb, such as "rtsg mirror ENDPOINT" for connect; empty if nothing
/// is known.
std::string hintForVerb(const std::string& word);
/// What to type in place of an option that a verb does not have: one of `known`, or what stands for it, as
/// "--size 1280x720" for --width; empty if nothing is known.
std::string hintForOption(const std::string& typed, const std::vector<std::string>& known);
/// An endpoint that is meant by one which is none, as tcp://127.0.0.1:5570 by localhost:5570; for a scene's file the
/// verb that serves it; empty if nothing is known.
std::string hintForEndpoint(const std::string& typed);

/// Throws UsageError, with the hint, if this is no endpoint.
void checkEndpoint(const std::string& option, const std::string& endpoint);

}  // namespace rtsg::app
