// DiffractionParts: the mechanisms of diffraction, each of which a measurement may leave out to see what it brings.
//
// Nothing else of the library writes it. Threading: written while nothing is traced and no wall changes.
#pragma once

namespace rtsg {

struct DiffractionParts {
    bool images = true;       // mirror images of first order bend
    bool roundBodies = true;  // cylinders and spheres are round; else their facets have edges
    bool smallBodies = true;  // what is small beside a wave lets it pass
    bool hiddenParts = true;  // edges that something hides in part bend as far as they are seen
};

inline DiffractionParts& diffractionParts() {
    static DiffractionParts parts;
    return parts;
}

}  // namespace rtsg
