// Says in a sentence where a room loses sound, and as JSON.
//
// Threading: pure functions.
#pragma once

#include <string>
#include <vector>

#include <rtsg/audio/room_openings.h>

namespace rtsg {

/// An object with the keys escaped and outdoors, and if an opening was found by it fraction, center, length, width,
/// area, leak and beside.
std::string openingsJson(const RoomOpenings& openings);
/// 3.1 % of the sound of A leaves the room, 2.9 % of it by a crack of 3 m x 1 cm near 6 0 1.5. `beside`: names of what
/// is there. Empty where nothing is lost, and in the open.
std::string lossText(const RoomOpenings& openings, const std::string& source, const std::string& beside);
/// 12 %, .5 %; two digits.
std::string percentText(double fraction);
/// With "and" before the last.
std::string listed(const std::vector<std::string>& names);
std::string namesBeside(const RoomOpenings& openings);

}  // namespace rtsg
