// Reading one mesh in each text encoding, against a loop of std::from_chars over the same numbers and a copy of the
// bytes.
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/filter.h>
#include <rtsg/core/loader.h>

#include "bench.h"

namespace rtsg::bench {

namespace {

struct Encoded {
    const char* name;
    const char* begin;  // of the document, up to the points
    const char* separator;
    const char* middle;  // between points and indices
    const char* end;
};

constexpr Encoded kEncodings[] = {
    {"ClassicVRML",
     "#X3D V4.0 utf8\nPROFILE Interchange\nShape { geometry IndexedTriangleSet { coord Coordinate { point [", " ",
     "] } index [", "] } }\n"},
    {"XML",
     "<?xml version='1.0' encoding='UTF-8'?><X3D version='4.0' profile='Interchange'><Scene><Shape><IndexedTriangleSet "
     "index='",
     " ", "'><Coordinate point='", "'/></IndexedTriangleSet></Shape></Scene></X3D>\n"},
    {"JSON",
     R"({"X3D":{"@version":"4.0","@profile":"Interchange","Scene":{"-children":[{"Shape":{"-geometry":)"
     R"({"IndexedTriangleSet":{"@index":[)",
     ",", R"(],"-coord":{"Coordinate":{"@point":[)", "]}}}}}}]}}}\n"},
};

std::string points(int n, const char* separator) {
    std::string text;
    for (int z = 0; z <= n; ++z)
        for (int x = 0; x <= n; ++x)
            fmt::format_to(std::back_inserter(text), "{3}{0:.5g}{4}{1:.5g}{4}{2:.5g}", x * .013f,
                           std::sin(x * .1f) * std::cos(z * .07f), z * .013f, text.empty() ? "" : separator, separator);
    return text;
}

std::string indices(int n, const char* separator) {
    std::string text;
    for (int z = 0; z < n; ++z)
        for (int x = 0; x < n; ++x) {
            const int a = z * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
            fmt::format_to(std::back_inserter(text), "{6}{0}{7}{1}{7}{2}{7}{3}{7}{4}{7}{5}", a, c, b, b, c, d,
                           text.empty() ? "" : separator, separator);
        }
    return text;
}

std::string document(const Encoded& encoding, int n) {
    const bool pointsFirst = std::strstr(encoding.begin, "point") != nullptr;
    std::string text = encoding.begin;
    text += pointsFirst ? points(n, encoding.separator) : indices(n, encoding.separator);
    text += encoding.middle;
    text += pointsFirst ? indices(n, encoding.separator) : points(n, encoding.separator);
    return text + encoding.end;
}

/// Keeps what it is given, as a scene would.
struct Keeper final : Filter {
    std::vector<Value> values;
    void setField(std::string_view, Value value, SourceLocation) override { values.push_back(std::move(value)); }
};

}  // namespace

void documents(const Report& report, bool quick) {
    const int n = quick ? 100 : 800;
    for (const Encoded& encoding : kEncodings) {
        const std::string text = document(encoding, n);
        const double megabytes = static_cast<double>(text.size()) / 1e6;
        std::vector<double> ours, naive, copy;
        for (int i = 0; i < 5; ++i) {
            double start = cpuSeconds();
            Keeper keeper;
            Diagnostics diagnostics;
            if (!readDocument(text, keeper, diagnostics) || !diagnostics.all().empty())
                throw std::logic_error("the document of the bench is not read");
            ours.push_back(cpuSeconds() - start);
            naive.push_back(fromCharsSeconds(text));
            start = cpuSeconds();
            std::string same(text.size(), '\0');
            std::memcpy(same.data(), text.data(), text.size());
            keep(same.data());
            copy.push_back(cpuSeconds() - start);
        }
        report({"documents", fmt::format("{} triangles, {}", 2 * n * n, encoding.name), "text read", "MB/s",
                megabytes / median(ours), "std::from_chars over the numbers", megabytes / median(naive),
                "memcpy of the text", megabytes / median(copy)});
    }
}

}  // namespace rtsg::bench
