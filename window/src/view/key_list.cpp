// The list of keys, in the order in which somebody needs them.
#include "key_list.h"

#include <utility>

namespace rtsg {

std::vector<OverlayContent::Line> keyList() {
    constexpr std::pair<const char*, const char*> kKeys[] = {
        {"arrow keys", "walk, fly or go round"},
        {"ALT + arrow keys", "sideways; in FLY also up and down; in EXAMINE along the picture"},
        {"drag", "go round, or look round"},
        {"drag by the right button", "in EXAMINE: along the picture"},
        {"wheel", "nearer or farther; a parallel view is enlarged"},
        {"PGUP, PGDN, HOME, END", "previous, next, first, last viewpoint"},
        {"click, drag on a thing", "what reacts does; the pointer is a hand there"},
        {"F6", "the next type: EXAMINE, WALK, FLY"},
        {"F7", "walls stop you or not: the way out of one"},
        {"F8", "gravity on or off"},
        {"F9", "see everything"},
        {"Ctrl+O, or drop a file", "open another scene"},
        {"Ctrl+Backspace", "back to the scene before"},
        {"Ctrl+S", "write a picture"},
        {"Ctrl+L, Ctrl+F", "begin or end a log, a film"},
        {"Ctrl+Space", "stop or continue time"},
        {"Ctrl+LEFT, Ctrl+RIGHT", "in a log: 5 s back or ahead"},
        {"F1", "figures, viewpoints, nodes and their fields"},
        {"F2", "this bar"},
        {"F3", "messages"},
        {"F11", "full screen"},
        {"?", "this list"},
        {"Escape", "close"}};
    std::vector<OverlayContent::Line> lines;
    for (const auto& [key, what] : kKeys) lines.push_back({key, what, false, {}});
    return lines;
}

}  // namespace rtsg
