// Fields whose words are no closed list: the standard allows others, so readers do not complain. A node that knows none
// of its words warns at run time, and names the word that it takes instead. ISO/IEC 19775-1 V4.0, 23.4.4, 38.3.1.
#pragma once

#include <algorithm>
#include <initializer_list>
#include <string>
#include <string_view>

#include <rtsg/core/behaviour.h>

namespace rtsg::behaviours {

/// `known` begins with the word that is taken instead. An empty list gives no warning.
inline void warnOfWords(Cascade& cascade, const Node& node, const char* field, const Array<String>& words,
                        std::initializer_list<std::string_view> known) {
    const auto isKnown = [&](const String& word) { return std::ranges::find(known, word.view()) != known.end(); };
    if (words.empty() || std::ranges::any_of(words, isKnown)) return;
    cascade.warn(node, field + (" " + words[0].str()) + " is not known: taken as " + std::string(*known.begin()));
}

}  // namespace rtsg::behaviours
