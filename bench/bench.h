// rtsg bench: measurements, each beside a naive baseline and a physical limit taken in the same run.
//
// Times are CPU time of this process unless a case says otherwise: on shared machines wall-clock time wobbles. Read
// the ratios. Threading: one thread unless a case says otherwise.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace rtsg::bench {

/// One figure; a baseline or limit without a name is none.
struct Line {
    std::string bench, name, metric, unit;
    double value = 0;
    std::string baselineName;
    double baseline = 0;
    std::string limitName;
    double limit = 0;
};
using Report = std::function<void(const Line&)>;

void read(const Report& report, bool quick);
void documents(const Report& report, bool quick);
void transform(const Report& report, bool quick);
void animated(const Report& report, bool quick);
void changes(const Report& report, bool quick);
void structure(const Report& report, bool quick);
void runtime(const Report& report, bool quick);
bool rays(const Report& report, bool quick);
void paths(const Report& report, bool quick);
/// False if there is no rasteriser here, or a scene cannot be made.
bool raster(const Report& report, bool quick);
/// False if the copy on the other thread differs.
bool overlap(const Report& report, bool quick);
void deform(const Report& report, bool quick);
void instances(const Report& report, bool quick);
void stage(const Report& report, bool quick);
void exporting(const Report& report, bool quick);
void features(const Report& report, bool quick);
/// False if a scene cannot be made.
bool sound(const Report& report, bool quick);

void touch(const Report& report, bool quick);
/// False if a line does not arrive.
bool feedsLatency(const Report& report, bool quick);

/// CPU time of this process in seconds.
double cpuSeconds();
double wallSeconds();
/// Core seconds so far that the machine's host gave to others while this machine wanted them; 0 where it does not say.
double stolenSeconds();
/// CPU time of the calling thread alone: what work costs who waits for it, whatever others do in the background.
double threadSeconds();
/// The cost of reading cpuSeconds() or threadSeconds(), which every figure taken with it contains once.
double cpuClockSeconds();
double median(std::vector<double> values);
/// Whether PATH has this program.
bool isInstalled(const std::string& program);
/// The resident memory of this process, after free memory was given back.
double residentBytes();
/// CPU seconds to parse every number in `text` with std::from_chars: the least a reader of text takes.
double fromCharsSeconds(const std::string& text);
/// Keeps a value from being optimised away.
inline void keep(const auto& value) {
    asm volatile("" : : "r,m"(value) : "memory");
}

}  // namespace rtsg::bench
