// The drawings of a report's page, as SVG.
//
// Threading: pure functions.
#pragma once

#include <string>
#include <string_view>

#include <rtsg/audio/room_report.h>

namespace rtsg {

/// Escapes text for a page.
std::string escapedText(std::string_view text);
/// "31.5", "500", "1k"; and "500 Hz", "1 kHz".
std::string octaveText(double hz);
std::string hertzText(double hz);

/// Decay curves of all octaves side by side, each from its onset on, with the lines of EDT, T20 and T30.
std::string decayChart(const RoomReport::Pair& pair);
/// Draws the levels in the octave of 1 kHz over time, relative to direct sound if there is any: exact arrivals by how
/// often they were reflected, and the rest as energy of milliseconds.
std::string reflectogram(const RoomReport::Pair& pair);
/// Energy over time and frequency.
std::string energogram(const RoomReport::Pair& pair);
/// The room from above: x to the right, z down.
std::string planChart(const RoomReport& report);
/// Reverberation times by octave: means of the traced values, and those of formulas.
std::string timesChart(const RoomReport& report);

}  // namespace rtsg
