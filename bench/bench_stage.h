// What `rtsg bench stage` consists of.
#pragma once

#include <string>

#include "bench.h"

namespace rtsg::bench {

/// In rows, floors and columns, by name B0, B1 ...: Transforms that hold one and the same Shape.
std::string manyBoxes(int count);
void stageLights(const Report& report, bool quick);
/// States for readers on other threads: what the scene's thread pays, and how long it waits.
void stageReaders(const Report& report, bool quick);
/// A subscriber that never polls, and the thread that merges for it.
void stageBus(const Report& report, bool quick);
void stageMemory(const Report& report, bool quick);

}  // namespace rtsg::bench
