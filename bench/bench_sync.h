// Benchmarks of rtsg::sync: codec, mirror and log, each beside what limits it (memcpy, raw ZeroMQ, raw write) in the
// same run. Plain functions, so that `rtsg bench` and tests can call them.
#pragma once

#include "bench.h"
#include "chart.h"

namespace rtsg::bench {

struct SyncSizes {
    int transforms = 10000;  // changed in every frame
    int frames = 400;
    int roundTrips = 2000;
    int joinNodes = 1000000;
    int peers = 64;
    int hourFrames = 216000;  // of the log that is sought in
};

/// Bytes and nanoseconds of a changed transform for every coding and mode, on three kinds of motion, beside general
/// compressors. False if anything failed to decode.
bool codec(const SyncSizes& sizes, const Report& report);
/// Bytes per second written and scanned, states per second replayed with verification, milliseconds to seek in an
/// hour's log, microseconds of the scene's thread.
bool log(const SyncSizes& sizes, const Report& report);

/// Bytes and CPU time of a frame in input mode, state mode beside it. Fails (false) if a replica's state differs.
bool input(const SyncSizes& sizes, const Report& report);

/// Bytes of a changed transform against error and against time.
bool chartCodec(const ChartSink& sink, bool quick);

/// All of them; false if one failed.
bool sync(const SyncSizes& sizes, const Report& report);

}  // namespace rtsg::bench
