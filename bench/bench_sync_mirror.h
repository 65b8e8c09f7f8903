// Benchmarks of the mirror, each beside raw ZeroMQ: the same bytes a frame in fresh buffers, the same sockets, the same
// number of frames under way, in the same run. Plain functions, so that `rtsg bench` and tests can call them.
#pragma once

#include "bench.h"
#include "bench_sync.h"
#include "chart.h"

namespace rtsg::bench {

/// Transforms per second from Scene::set to the replica's verified hash, over loopback TCP and ipc. Fails (false) if
/// any replica state differs.
bool mirrorThroughput(const SyncSizes& sizes, const Report& report);
/// Microseconds from newFrame() to the replica's state, one change at a time.
bool mirrorLatency(const SyncSizes& sizes, const Report& report);
/// Milliseconds from connect() to a verified replica, and what the joiner costs the scene's thread meanwhile.
bool mirrorJoin(const SyncSizes& sizes, const Report& report);
/// Milliseconds from the return of a link that was cut to a replica in step.
bool mirrorResume(const SyncSizes& sizes, const Report& report);
/// Frames a second to many replicas, and with a part of them stopped.
bool mirrorPeers(const SyncSizes& sizes, const Report& report);
/// Frames of 13 kB a second to four times as many, each with the origin's hash; milliseconds until sixteen times as
/// many have a frame, beside a bare PUB socket with the same bytes, and seconds until they have joined.
bool mirrorCrowd(const SyncSizes& sizes, const Report& report);

/// The cost of parts by region for a frame, in scenes of several sizes, beside mirrors of the whole. Returns false if
/// any replica's state differs.
bool mirrorRegions(const SyncSizes& sizes, const Report& report);

/// Replicas against throughput, late joins against the size of the scene.
bool chartMirror(const ChartSink& sink, bool quick);

}  // namespace rtsg::bench
