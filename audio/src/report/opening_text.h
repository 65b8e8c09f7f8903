// Describes where the sound of a room is lost: as lines of a report, as JSON and as a table of a page.
//
// Threading: pure functions.
#pragma once

#include <string>

#include <rtsg/audio/room_openings.h>
#include <rtsg/audio/room_report.h>

namespace rtsg {

/// An object with the keys escaped, elsewhere, outdoors and openings.
std::string openingsJson(const RoomOpenings& openings);
/// A heading and a line for each opening; nothing where no room loses anything.
std::string lossesText(const RoomReport& report);
std::string lossesHtml(const RoomReport& report);
/// 3 m x 1 mm, say.
std::string sizeText(const RoomOpening& opening);
/// 12 %, .5 %; two digits.
std::string percentText(double fraction);

}  // namespace rtsg
