// Writes numbers and figures as JSON.
//
// NaN and infinity are null. Threading: pure functions.
#pragma once

#include <string>
#include <string_view>

#include <rtsg/audio/room_metrics.h>
#include <rtsg/audio/speech_transmission.h>
#include <rtsg/core/field_text.h>

namespace rtsg {

std::string jsonNumber(double value);
std::string jsonArray(const Bands& values);
/// {"walls":…,"figures":…}: bands that were computed, of which the others are copies.
std::string jsonBandsComputed(int walls, int figures);
/// "EDT_s":[…],… without braces.
std::string jsonFigures(const RoomMetrics& metrics);
/// "STI":…,"STI_ci95":…,"MTI":[…],"speech_level_db":[…] without braces.
std::string jsonSpeech(const SpeechEstimate& speech);
/// {"standard":…,"voice":…,"level_dba_1m":…,"noise_db":[…]}.
std::string jsonSpeechOptions(const SpeechOptions& speech);
/// "curvature_percent":[…],"two_slopes":[…],"early_slope_s":[…],"late_slope_s":[…] without braces.
std::string jsonSlopes(const MetricsEstimate& metrics);

}  // namespace rtsg
