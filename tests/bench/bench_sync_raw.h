// Raw ZeroMQ as the mirror's baseline: the same sockets (ROUTER to DEALER), the same parts and bytes, but nothing in
// them.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace rtsg::bench {

/// Bytes per second in messages of `size`, each in a buffer of its own that is written before and read after, with at
/// most `underWay` of them not yet received; between two threads.
double rawThroughput(const std::string& endpoint, std::size_t size, int messages, int underWay = 16);
/// Microseconds from sending to having received `size` bytes, one message at a time, sorted.
std::vector<double> rawLatency(std::size_t size, int messages);

}  // namespace rtsg::bench
