// Fields whose words are no closed list: the standard allows others, so that no reader complains, and a node that knows
// none of those it has says at run time what it takes instead. ISO/IEC 19775-1 V4.0, 23.4.4, 38.3.1.
#pragma once

#include <algorithm>
#include <initializer_list>
#include <string>
#include <string_view>

#include <rtsg/core/behaviour.h>

namespace rtsg::behaviours {

/// `known`: the word that is taken instead comes first. Nothing is said where there are no words.
inline void warnOfWords(Cascade& cascade, const Node& node, const char* field, const Array<String>& words,
                        std::initializer_list<std::string_view> known) {
    const auto isKnown = [&](const String& word) { return std::ranges::find(known, word.view()) != known.end(); };
    if (words.empty() || std::ranges::any_of(words, isKnown)) return;
    cascade.warn(node, field + (" " + words[0].str()) + " is not known: taken as " + std::string(*known.begin()));
}

}  // namespace rtsg::behaviours
