// Mirror images against the lattice of a box, against all words of a polyhedron, and where methods fail.
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include <gtest/gtest.h>

#include "audio/triangle_geometry.h"
#include "images/image_sources.h"
#include "rays/acoustic_tracer.h"

namespace rtsg {
namespace {

using test::kListener;
using test::kSource;
using test::Shoebox;
using test::TriangleGeometry;

ImageSources images(const AcousticGeometry& geometry, int order, const glm::dvec3& source = kSource,
                    const glm::dvec3& listener = kListener) {
    return findImageSources(geometry, source, listener, {.maxOrder = order}, 343, Bands{});
}

TEST(PlaneMerger, SixPlanesInAFinelyTessellatedBox) {
    PlaneMerger merger;
    constexpr int n = 20;
    for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side)
            for (int i = 0; i < n; ++i)
                for (int j = 0; j < n; ++j) {
                    const auto at = [&](int u, int v) {
                        glm::dvec3 p;
                        p[axis] = side * 3.0;
                        p[(axis + 1) % 3] = 6.0 * u / n;
                        p[(axis + 2) % 3] = 5.0 * v / n;
                        // Turned, and rounded as a file would.
                        const double c = std::cos(0.7), s = std::sin(0.7);
                        return glm::dvec3(glm::vec3(glm::dvec3(c * p.x - s * p.y, s * p.x + c * p.y, p.z)));
                    };
                    // Alternate windings: which side a triangle faces is no matter.
                    const bool flip = (i + j) % 2 != 0;
                    const std::uint32_t a = merger.add(at(i, j), at(i + 1, j), at(i, j + 1));
                    const std::uint32_t b = flip ? merger.add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1))
                                                 : merger.add(at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
                    EXPECT_EQ(a, b);
                }
    EXPECT_EQ(merger.finish().size(), 6u);
}

TEST(PlaneMerger, KeepsDistinctPlanesApartAndRefusesDegenerateTriangles) {
    PlaneMerger merger;
    EXPECT_EQ(merger.add({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), 0u);
    EXPECT_EQ(merger.add({0, 0, 0.01}, {1, 0, 0.01}, {0, 1, 0.01}), 1u);
    EXPECT_EQ(merger.add({0, 0, 0}, {1, 0, 0.02}, {0, 1, 0}), 2u);
    EXPECT_EQ(merger.add({5, 5, 0}, {5, 6, 0}, {6, 5, 0}), 0u);
    EXPECT_EQ(merger.add({0, 0, 0}, {1, 1, 1}, {2, 2, 2}), kNoPlane);
    EXPECT_EQ(merger.add({0, 0, 0}, {NAN, 1, 1}, {2, 0, 2}), kNoPlane);
    const auto planes = merger.finish();
    ASSERT_EQ(planes.size(), 3u);
    EXPECT_GT(planes[0].radius, 3.5);
}

TEST(ImageSources, CountsOfTheBox) {
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, 0.1).geometry();
    ASSERT_EQ(box.planes().size(), 6u);
    EXPECT_EQ(images(box, 0).arrivals.size(), 1u);
    EXPECT_EQ(images(box, 1).arrivals.size(), 7u);
    EXPECT_EQ(images(box, 3).arrivals.size(), 63u);
    EXPECT_EQ(images(box, 6).arrivals.size(), 377u);
    EXPECT_EQ(images(box, 20).arrivals.size(), 11521u);
    EXPECT_EQ(images(box, 6).order, 6);
}

TEST(ImageSources, FirstArrivalsAndMultiplicities) {
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, 0.1).geometry();
    const ImageSources found = images(box, 6);
    struct Expected {
        std::uint32_t order;
        double ms, db;
        std::size_t multiplicity;
    };
    std::size_t at = 0;
    for (const Expected& e : {Expected{0, 10.5118, 0, 1},
                              {1, 13.6747, -2.742, 2},
                              {1, 14.5773, -3.298, 1},
                              {1, 15.7002, -3.942, 1},
                              {2, 16.9999, -5.091, 2},
                              {2, 17.9721, -5.574, 2},
                              {2, 18.6680, -5.904, 1},
                              {1, 19.5574, -5.850, 1},
                              {2, 20.4082, -6.678, 2}}) {
        for (std::size_t i = 0; i < e.multiplicity; ++i, ++at) {
            const Arrival& a = found.arrivals[at];
            EXPECT_EQ(a.order, e.order) << e.ms;
            EXPECT_NEAR(a.seconds * 1000, e.ms, 1e-4);
            EXPECT_NEAR(10 * std::log10(a.energy[2] / found.arrivals[0].energy[2]), e.db, 1e-3);
        }
        EXPECT_GT(found.arrivals[at].seconds * 1000, e.ms + 1e-3) << "multiplicity of the arrival at " << e.ms;
    }
}

TEST(ImageSources, EveryImageOfAnUnevenBoxAgreesWithTheLattice) {
    Shoebox box;
    box.absorption = {.05, .1, .2, .4, .6, .8};
    std::multimap<double, double> lattice;
    box.images(kSource, kListener, 200, [&](double distance, double energy, int order) {
        if (order <= 9) lattice.emplace(distance, energy);
    });
    const ImageSources found = images(box.geometry(), 9);
    ASSERT_EQ(found.arrivals.size(), lattice.size());
    // Equal distances may come in either order: compare sums over what lies within a micrometre.
    auto it = lattice.begin();
    for (std::size_t i = 0; i < found.arrivals.size();) {
        const double distance = it->first;
        double expected = 0, got = 0;
        for (; it != lattice.end() && it->first < distance + 1e-6; ++it) {
            expected += it->second;
            EXPECT_NEAR(found.arrivals[i].seconds * 343, distance, 2e-6);
            got += found.arrivals[i++].energy[0];
        }
        ASSERT_NEAR(got, expected, 1e-9 * expected);
    }
}

TEST(ImageSources, ATurnedBoxInSinglePrecisionHasTheSameImages) {
    const auto rotation = [](const glm::dvec3& p) {
        const double c = std::cos(0.4), s = std::sin(0.4);
        const glm::dvec3 q(c * p.x - s * p.y, s * p.x + c * p.y, p.z);
        return glm::dvec3(q.x + 20, c * q.y - s * q.z, s * q.y + c * q.z);
    };
    const auto rounded = [&](const glm::dvec3& p) { return glm::dvec3(glm::vec3(rotation(p))); };
    TriangleGeometry box;
    const std::uint32_t m = box.addMaterial(0.1, 0);
    const auto quad = [&](glm::dvec3 a, glm::dvec3 b, glm::dvec3 c, glm::dvec3 d) {
        box.addQuad(rounded(a), rounded(b), rounded(c), rounded(d), m);
    };
    quad({0, 0, 0}, {6, 0, 0}, {6, 5, 0}, {0, 5, 0});
    quad({0, 0, 3}, {6, 0, 3}, {6, 5, 3}, {0, 5, 3});
    quad({0, 0, 0}, {6, 0, 0}, {6, 0, 3}, {0, 0, 3});
    quad({0, 5, 0}, {6, 5, 0}, {6, 5, 3}, {0, 5, 3});
    quad({0, 0, 0}, {0, 5, 0}, {0, 5, 3}, {0, 0, 3});
    quad({6, 0, 0}, {6, 5, 0}, {6, 5, 3}, {6, 0, 3});
    box.finish();
    const ImageSources turned = images(box, 6, rotation(kSource), rotation(kListener));
    const ImageSources straight = images(Shoebox::uniform({6, 5, 3}, 0.1).geometry(), 6);
    ASSERT_EQ(turned.arrivals.size(), 377u);
    // Rounding may swap arrivals that come together: compare what has come up to each gap.
    double difference = 0;
    for (std::size_t i = 0; i < 377; ++i) {
        EXPECT_NEAR(turned.arrivals[i].seconds, straight.arrivals[i].seconds, 1e-7);
        difference += turned.arrivals[i].energy[0] - straight.arrivals[i].energy[0];
        if (i == 376 || straight.arrivals[i + 1].seconds > straight.arrivals[i].seconds + 1e-6) {
            EXPECT_NEAR(difference / straight.arrivals[i].energy[0], 0, 1e-3) << i;
        }
    }
}

TEST(ImageSources, DirectSoundFollowsTheInverseSquareAndTheDelay) {
    TriangleGeometry nothing;
    nothing.finish();
    for (const double d : {0.5, 1.0, 7.0, 343.0}) {
        const ImageSources found = images(nothing, 3, {0, 0, 0}, {0, d, 0});
        ASSERT_EQ(found.arrivals.size(), 1u);
        EXPECT_NEAR(found.arrivals[0].seconds * 48000, d / 343 * 48000, 1e-6);
        EXPECT_NEAR(found.arrivals[0].energy[0] * 4 * M_PI * d * d, 1, 1e-12);
        EXPECT_NEAR(found.arrivals[0].direction.y, -1, 1e-12);
    }
    Air air;
    air.relativeHumidity = 70;
    const auto m = airAttenuation(air);
    const auto far = findImageSources(nothing, {0, 0, 0}, {100, 0, 0}, {.maxOrder = 0}, 343, m);
    EXPECT_NEAR(10 * std::log10(far.arrivals[0].energy[kBand1k + 3] * 4 * M_PI * 1e4), -7.66, 0.01);
}

TEST(ImageSources, WallsBlockAndThinWallsLetThrough) {
    for (const double transmission : {0.0, 0.25}) {
        TriangleGeometry wall;
        wall.addBox({1, -1, -1}, {1.1, 1, 1}, {0, 0, 0, 0, 0, 0});
        wall.addMaterial(0.5, 0, transmission);
        wall.finish();
        const ImageSources found = images(wall, 2, {0, 0, 0}, {2, 0, 0});
        if (transmission == 0) {
            EXPECT_TRUE(found.arrivals.empty());
        } else {
            // Straight through both faces; what is reflected between them comes later.
            ASSERT_GE(found.arrivals.size(), 2u);
            EXPECT_NEAR(found.arrivals[0].energy[0] * 4 * M_PI * 4, 1.0 / 16, 1e-12);
        }
        // Past the edge it is free; the face that looks at both of them gives one reflection.
        EXPECT_EQ(images(wall, 0, {0, 0, 0}, {2, 3, 0}).arrivals.size(), 1u);
        // One that lets sound pass reflects with its back as well.
        EXPECT_EQ(images(wall, 2, {0, 0.1, 0}, {0, -0.1, 0}).arrivals.size(), transmission == 0 ? 2u : 5u);
    }
}

TEST(ImageSources, DiffractionFreeShadowOfAScreenWithAWindow) {
    // Two walls in one plane: one image, valid only where it meets one of them.
    TriangleGeometry walls;
    const std::uint32_t hard = walls.addMaterial(0.0, 0), soft = walls.addMaterial(0.75, 0);
    walls.addQuad({-3, 0, -1}, {-1, 0, -1}, {-1, 0, 1}, {-3, 0, 1}, hard);
    walls.addQuad({1, 0, -1}, {3, 0, -1}, {3, 0, 1}, {1, 0, 1}, soft);
    walls.finish();
    ASSERT_EQ(walls.planes().size(), 1u);
    EXPECT_EQ(images(walls, 3, {-0.5, 2, 0}, {0.5, 2, 0}).arrivals.size(), 1u);  // through the window
    const auto left = images(walls, 3, {-2.5, 2, 0}, {-1.5, 2, 0}), right = images(walls, 3, {2.5, 2, 0}, {1.5, 2, 0});
    ASSERT_EQ(left.arrivals.size(), 2u);
    ASSERT_EQ(right.arrivals.size(), 2u);
    EXPECT_NEAR(right.arrivals[1].energy[0] / left.arrivals[1].energy[0], 0.25, 1e-12);
}

TEST(ImageSources, StopsAtTheOrderTheBudgetAllows) {
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, 0.1).geometry();
    const ImageSources found =
        findImageSources(box, kSource, kListener, {.maxOrder = 12, .maxCandidates = 500}, 343, {});
    EXPECT_EQ(found.order, 6);
    EXPECT_EQ(found.arrivals.size(), 377u);
}

TEST(ImageSources, PositionsWhereEveryPathMeetsEdges) {
    // Both in the middle of a cube: by symmetry most images of order two and more are seen exactly along edges.
    const TriangleGeometry cube = Shoebox::uniform({4, 4, 4}, 0.0).geometry();
    EXPECT_EQ(images(cube, 4, {2, 2, 1}, {2, 2, 3}).arrivals.size(), 129u);
    EXPECT_EQ(images(cube, 4, {1, 1, 1}, {3, 3, 3}).arrivals.size(), 129u);
}

/// The set of images of the lattice and the one that was found, as sums over what arrives together.
void expectLattice(const ImageSources& found, const Shoebox& box, const glm::dvec3& source, const glm::dvec3& listener,
                   int maxOrder, double same) {
    std::vector<std::pair<double, double>> lattice;
    box.images(source, listener, 400, [&](double distance, double energy, int order) {
        // A source nearer than a centimetre has the energy of that distance.
        if (distance < .01) energy = std::pow(1 - box.absorption[0], order) / (4 * M_PI * 1e-4);
        if (order <= maxOrder) lattice.emplace_back(distance, energy);
    });
    std::sort(lattice.begin(), lattice.end());
    ASSERT_EQ(found.arrivals.size(), lattice.size());
    double expected = 0, got = 0;
    for (std::size_t i = 0; i < lattice.size(); ++i) {
        EXPECT_NEAR(found.arrivals[i].seconds * 343, lattice[i].first, same) << i;
        expected += lattice[i].second;
        got += found.arrivals[i].energy[0];
        if (i + 1 == lattice.size() || lattice[i + 1].first > lattice[i].first + 3 * same) {
            ASSERT_NEAR(got / expected, 1, 1e-4) << i;
        }
    }
}

TEST(ImageSources, AtWallsEdgesAndCornersTheSetIsThatOfTheLattice) {
    const Shoebox box = Shoebox::uniform({6, 5, 3}, .1);
    const TriangleGeometry room = box.geometry();
    const double e = 1e-4, f = 1e-7;
    for (const glm::dvec3& source : {glm::dvec3(e, 1, 1.5), glm::dvec3(f, 1, 1.5), glm::dvec3(0, 1, 1.5),
                                     glm::dvec3(e, e, 1.5), glm::dvec3(0, 0, 1.5), glm::dvec3(0, 0, 0), kSource})
        for (const glm::dvec3& listener : {kListener, glm::dvec3(5.9999, 3, 1.5), glm::dvec3(6, 3, 1.5),
                                           glm::dvec3(6, 5, 1.5), glm::dvec3(6, 5, 3), glm::dvec3(0, 3, 1.5)}) {
            SCOPED_TRACE(testing::Message() << source.x << " " << source.y << " " << source.z << " to " << listener.x
                                            << " " << listener.y << " " << listener.z);
            expectLattice(images(room, 5, source, listener), box, source, listener, 5, 1e-4);
        }
}

TEST(ImageSources, CoincidentPlacesAtAWall) {
    const Shoebox box = Shoebox::uniform({6, 5, 3}, .1);
    for (const glm::dvec3& position : {kSource, glm::dvec3(1e-4, 1, 1.5), glm::dvec3(0, 1, 1.5)})
        expectLattice(images(box.geometry(), 4, position, position), box, position, position, 4, 1e-4);
}

/// Every word of walls tried one by one, checked by reflecting the points of its path.
std::vector<double> bruteForceImages(const std::vector<std::pair<glm::dvec3, double>>& planes, const glm::dvec3& source,
                                     const glm::dvec3& listener, std::size_t maxOrder) {
    std::vector<double> distances;
    std::vector<std::size_t> word;
    const auto inside = [&](const glm::dvec3& p, std::size_t but) {
        for (std::size_t i = 0; i < planes.size(); ++i)
            if (i != but && glm::dot(planes[i].first, p) > planes[i].second) return false;
        return true;
    };
    const auto valid = [&] {
        std::vector<glm::dvec3> image{source};
        for (const std::size_t w : word) {
            const auto& [n, d] = planes[w];
            image.push_back(image.back() - 2 * (glm::dot(n, image.back()) - d) * n);
        }
        glm::dvec3 at = listener;
        for (std::size_t k = word.size(); k-- > 0;) {
            const auto& [n, d] = planes[word[k]];
            const double a = glm::dot(n, at) - d, b = glm::dot(n, image[k + 1]) - d;
            if (!(a < 0 && b > 0)) return -1.0;
            at = glm::mix(at, image[k + 1], a / (a - b));
            if (!inside(at, word[k])) return -1.0;
        }
        return glm::distance(listener, image.back());
    };
    const std::function<void()> deeper = [&] {
        if (const double d = valid(); d >= 0) distances.push_back(d);
        if (word.size() == maxOrder) return;
        for (std::size_t i = 0; i < planes.size(); ++i) {
            if (!word.empty() && word.back() == i) continue;
            word.push_back(i);
            deeper();
            word.pop_back();
        }
    };
    deeper();
    std::sort(distances.begin(), distances.end());
    return distances;
}

TEST(ImageSources, AConvexPolyhedronHasTheImagesOfAllWords) {
    // A prism over a skew pentagon with a slanted roof: no two walls at a right angle but those of the floor.
    const std::vector<glm::dvec2> base{{0, 0}, {5, -.7}, {7, 2.1}, {3.3, 5.2}, {-.8, 3.1}};
    const auto roof = [](const glm::dvec2& p) { return 3 + .11 * p.x - .07 * p.y; };
    TriangleGeometry room;
    const std::uint32_t m = room.addMaterial(.1, 0);
    std::vector<std::pair<glm::dvec3, double>> planes;
    const glm::dvec3 middle(2.9, 2, 1.4);
    const auto face = [&](const std::vector<glm::dvec3>& corners) {
        for (std::size_t i = 2; i < corners.size(); ++i) room.addTriangle(corners[0], corners[i - 1], corners[i], m);
        glm::dvec3 n = glm::normalize(glm::cross(corners[1] - corners[0], corners[2] - corners[0]));
        if (glm::dot(n, middle - corners[0]) > 0) n = -n;
        planes.emplace_back(n, glm::dot(n, corners[0]));
    };
    std::vector<glm::dvec3> floor, top;
    for (std::size_t i = 0; i < base.size(); ++i) {
        const glm::dvec2 a = base[i], b = base[(i + 1) % base.size()];
        floor.emplace_back(a, 0);
        top.emplace_back(a, roof(a));
        face({{a, 0}, {b, 0}, {b, roof(b)}, {a, roof(a)}});
    }
    face(floor);
    face(top);
    room.finish();
    ASSERT_EQ(room.planes().size(), 7u);
    const glm::dvec3 listener(4.2, 2.6, 1.1);
    for (const glm::dvec3& source : {glm::dvec3(1.3, 1.1, 1.7), glm::dvec3(1.3, 1.1, 1e-4)}) {
        const std::vector<double> expected = bruteForceImages(planes, source, listener, 5);
        const ImageSources found = images(room, 5, source, listener);
        ASSERT_EQ(found.arrivals.size(), expected.size());
        EXPECT_GT(expected.size(), 60u);
        for (std::size_t i = 0; i < expected.size(); ++i)
            EXPECT_NEAR(found.arrivals[i].seconds * 343, expected[i], 1e-9);
    }
}

TEST(ImageSources, ASlabOfTwoSheetsPassesAllThatIsReflectedInIt) {
    // Between the sheets sound goes to and fro: 1 / (1 - r^2) of what passes both at once, were there no distances.
    TriangleGeometry slab;
    const std::uint32_t sheet = slab.addMaterial(.1, 0, .4);  // mirrors .5
    for (const double x : {0.0, .05}) slab.addQuad({x, -50, -50}, {x, 50, -50}, {x, 50, 50}, {x, -50, 50}, sheet);
    slab.finish();
    const ImageSources found = images(slab, 12, {-2, 0, 0}, {3, 0, 0});
    double expected = 0;
    for (int k = 0; k <= 6; ++k) expected += .16 * std::pow(.25, k) / (4 * M_PI * std::pow(5 + .1 * k, 2));
    double got = 0;
    for (const Arrival& a : found.arrivals) got += a.energy[0];
    EXPECT_EQ(found.arrivals.size(), 7u);
    EXPECT_NEAR(got, expected, 1e-6 * expected);
}

/// The floor, and before it a mirror that stands on the plane z = .5.
test::TriangleGeometry mirrorOnAFloor(double width) {
    test::TriangleGeometry geometry;
    const std::uint32_t material = geometry.addMaterial(0, 0);
    const double x = .5 * width;
    geometry.addQuad({-50, 0, -50}, {-50, 0, 50}, {50, 0, 50}, {50, 0, -50}, material);
    geometry.addQuad({-x, 0, .5}, {x, 0, .5}, {x, 3, .5}, {-x, 3, .5}, material);
    geometry.finish();
    return geometry;
}

/// The share of a ball from which the source's image in the floor and the mirror is seen in the latter.
double fractionOfBall(double width, const glm::dvec3& source, const glm::dvec3& listener, double radius) {
    constexpr int kSteps = 60;
    const glm::dvec3 image(source.x, -source.y, 1 - source.z);
    int inside = 0, seen = 0;
    for (int i = -kSteps; i <= kSteps; ++i)
        for (int j = -kSteps; j <= kSteps; ++j)
            for (int k = -kSteps; k <= kSteps; ++k) {
                const glm::dvec3 off = radius / kSteps * glm::dvec3(i, j, k), at = listener + off;
                if (glm::length(off) > radius) continue;
                ++inside;
                const double met = (image.z - .5) / (image.z - at.z);
                seen += met > 0 && met < 1 && std::abs(image.x + met * (at.x - image.x)) < .5 * width;
            }
    return static_cast<double>(seen) / inside;
}

TEST(ImageSources, WhatIsMirroredTwiceIsTheMeanOverTheBall) {
    const glm::dvec3 source(-3, 1.5, 0);
    TraceOptions options;
    options.rays = 2;
    options.imageOrder = 2;
    options.maxSeconds = .5;
    options.receiverRadius = .5;
    options.air.absorbs = false;
    for (const double width : {.2, .6, 1.5}) {
        const test::TriangleGeometry geometry = mirrorOnAFloor(width);
        double before = -1;
        for (int z = -60; z <= 40; ++z) {
            const glm::dvec3 listener(3, 1.5, .01 * z);
            const double distance = glm::distance(glm::dvec3(-3, -1.5, 1), listener);
            double twice = 0;
            for (const Arrival& arrival : AcousticTracer(geometry).trace(source, listener, options).arrivals) {
                if (arrival.order != 2) continue;
                EXPECT_NEAR(arrival.seconds, distance / options.air.speedOfSound, 1e-9);
                twice += arrival.energy[kBand1k] * 4 * M_PI * distance * distance;
            }
            // If all of 8 places see it, or none does, this is taken for the whole ball.
            if (z % 10 == 0) {
                EXPECT_NEAR(twice, fractionOfBall(width, source, listener, .5), .15) << width << " " << listener.z;
            }
            if (before >= 0) {
                EXPECT_NEAR(twice, before, .3) << width << " " << listener.z;
            }
            before = twice;
        }
    }
}

}  // namespace
}  // namespace rtsg
