// Elementary functions whose results have the same bits with every C library, compiler and processor.
//
// C libraries round them differently, and one library may differ between processors. Everything that reaches the state
// of a scene is computed with these functions: then state hashes agree, and a session that is run again elsewhere from
// its inputs is the same. For pictures and sound, std::sin and the like are good enough. (std::sqrt, std::fmod,
// std::remainder and rounding to whole numbers are exact by IEEE 754.)
//
// Accuracy: at most 1 unit in the last place, subnormal results included. Arguments outside the domain give NaN; zeros,
// infinities and NaN are treated as in ISO C, annex F. Threading: functions without state. They expect the default
// rounding, to nearest, and set no errno. Source: P. T. P. Tang's table-driven methods (ACM TOMS 15, 1989, and 16,
// 1990); error-free sums and products by Knuth and Dekker (1971).
#pragma once

#include <span>

namespace rtsg::portable {

/// Angles are in radians.
double sin(double angle);
double cos(double angle);
double tan(double angle);
struct SineCosine {
    double sine, cosine;
};
/// Both at once, with the same bits as sin() and cos(), for little more than one of them.
SineCosine sineCosine(double angle);

/// Results are in radians.
double asin(double x);
double acos(double x);
double atan(double x);
/// The angle of the direction (x, y) from the x axis, in [-pi, pi].
double atan2(double y, double x);

double exp(double x);
/// exp(x) - 1, also where exp(x) is nearly 1.
double expm1(double x);
double log(double x);
/// log(1 + x), also where x is nearly 0.
double log1p(double x);
double log2(double x);
double log10(double x);
double pow(double base, double exponent);

double sinh(double x);
double cosh(double x);
double tanh(double x);
double asinh(double x);
double acosh(double x);
double atanh(double x);

double cbrt(double x);
/// The root of the sum of squares, without overflow on the way.
double hypot(double x, double y);
double hypot(double x, double y, double z);
double hypot(std::span<const double> components);

}  // namespace rtsg::portable
