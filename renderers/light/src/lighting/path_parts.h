// PathParts: switches for the accelerations of the path tracer, for measurements of what each gains.
//
// Invariant: pictures have the same mean with and without them; only the noise differs. Nothing else in the library
// changes them. Threading: change them while no picture is made.
#pragma once

namespace rtsg::trace {

struct PathParts {
    bool emitters = true;    // shining triangles are asked directly; else bounces alone find them
    bool lightTree = true;   // chooses by possible contribution; otherwise all are equally likely
    bool skyLight = true;    // an uneven sky is asked directly; else bounces alone find it
    bool wavefronts = true;  // in stages, where goesInWavefronts(); else packet by packet
    bool largeFirst = true;  // of those, a few large triangles before all trees, where LargeRays pay
    float roulette = .25f;   // the weight, of the first one's, below which Russian roulette begins
};

inline PathParts& pathParts() {
    static PathParts parts;
    return parts;
}

}  // namespace rtsg::trace
