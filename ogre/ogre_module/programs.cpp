// The sources of the GLSL programs.
#include "programs.h"

namespace rtsg {

namespace {

const char* const kVertex = R"(
uniform mat4 world, viewProjection;
uniform vec4 eyePlace, eyeForward;
in vec4 vertex;
in vec3 normal;
in vec3 uv0;
in vec4 uv1;
out vec3 place, surfaceNormal, coordinates;
out vec4 color;
out float depth;
void main() {
    vec4 at = world * vertex;
    place = at.xyz;
    mat3 m = mat3(world);
    // The cofactors turn normals as the inverse transpose does, up to a factor, and need no division.
    surfaceNormal = mat3(cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])) * normal;
    if (dot(cross(m[0], m[1]), m[2]) < 0.0) surfaceNormal = -surfaceNormal;
    coordinates = uv0;
    color = uv1;
    depth = dot(at.xyz - eyePlace.xyz, eyeForward.xyz);
    gl_Position = viewProjection * at;
}
)";

// A line is drawn as a rectangle around its ends, with its width in the picture and half of that added at each end. The
// fragment program finds the nearest point on the axis in the picture, and its attributes, and discards fragments that
// are farther from it than half the width.
const char* const kStrokeVertex = R"(
uniform mat4 world, viewProjection;
uniform vec4 eyePlace, eyeForward, pictureSize;
uniform vec4 stroke, attenuation;
in vec4 vertex;
in vec3 normal;
in vec3 uv0;
in vec3 uv1;
in vec4 uv2;
in vec4 uv3;
in vec4 uv4;
flat out vec3 startPlace, endPlace, startNormal, endNormal;
flat out vec4 startColor, endColor, ends;
flat out vec2 fogEnds;
noperspective out vec3 inPicture;
flat out float halfWidth;
vec3 turned(mat3 m, vec3 n, vec3 along) {
    n = mat3(cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])) * n;
    if (dot(cross(m[0], m[1]), m[2]) < 0.0) n = -n;
    if (dot(along, along) == 0.0) return n;
    vec3 across = n - along * (dot(along, n) / dot(along, along));
    return length(across) > 1e-3 * length(n) ? across : n;
}
void main() {
    vec3 a = (world * vertex).xyz, b = (world * vec4(uv0, 1.0)).xyz;
    startPlace = a, endPlace = b;
    startNormal = turned(mat3(world), normal, b - a), endNormal = turned(mat3(world), uv1, b - a);
    startColor = uv2, endColor = uv3, fogEnds = uv4.zw;
    // What lies behind the eye is cut off before it is projected.
    float da = dot(a - eyePlace.xyz, eyeForward.xyz), db = dot(b - eyePlace.xyz, eyeForward.xyz);
    float first = 0.0, last = 1.0;
    if (eyePlace.w == 0.0) {
        float least = 1e-4 * max(da, db);
        if (da < least) first = (least - da) / (db - da);
        if (db < least) last = (least - da) / (db - da);
    }
    vec3 start = mix(a, b, first), end = mix(a, b, last);
    vec4 pa = viewProjection * vec4(start, 1.0), pb = viewProjection * vec4(end, 1.0);
    ends = vec4(first, last, 1.0 / pa.w, 1.0 / pb.w);
    vec2 inA = pa.xy / pa.w * 0.5 * pictureSize.xy, inB = pb.xy / pb.w * 0.5 * pictureSize.xy;
    halfWidth = 0.5 * stroke.x;
    if (attenuation.w > 0.0) {
        float r = length(a - eyePlace.xyz);
        float fall = attenuation.x + r * (attenuation.y + r * attenuation.z);
        halfWidth = 0.5 * clamp(stroke.x / max(fall, 1e-6), stroke.z, stroke.w);
    }
    bool atEnd = uv4.x > 0.5;
    vec2 way = inB - inA;
    float size = length(way);
    vec2 ahead = size > 1e-6 ? way / size : vec2(1.0, 0.0), beside = vec2(-ahead.y, ahead.x);
#ifdef POINTS
    vec2 offset = halfWidth * vec2(atEnd ? 1.0 : -1.0, uv4.y);
#else
    vec2 offset = (halfWidth + 0.5) * (beside * uv4.y + ahead * (atEnd ? 1.0 : -1.0));
#endif
    inPicture = vec3((atEnd ? size : 0.0) + dot(offset, ahead), dot(offset, beside), size);
    vec4 at = atEnd ? pb : pa;
    gl_Position = at + vec4(offset / (0.5 * pictureSize.xy) * at.w, 0.0, 0.0);
    if (da <= 0.0 && db <= 0.0 && eyePlace.w == 0.0) gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
}
)";

const char* const kBackgroundVertex = R"(
uniform mat4 projection;
in vec4 vertex;
out vec2 corner;
void main() {
    corner = vertex.xy;
    // Pictures that are drawn into textures are upside down, which the projection says.
    gl_Position = vec4(vertex.x, projection[1][1] < 0.0 ? -vertex.y : vertex.y, 0.0, 1.0);
}
)";

const char* const kBackgroundFragment = R"(
uniform sampler2D colors, side0, side1, side2, side3, side4, side5;
uniform vec4 eyePlace, eyeForward, eyeRight, eyeUp, eyeEdges;
uniform mat4 localFromWorld;
uniform vec4 sidesFirst, sidesLast;
in vec2 corner;
out vec4 result;
const float kPi = 3.14159265358979;
vec4 sideColor(int side, vec2 st) {
    if (side == 0) return textureLod(side0, st, 0.0);
    if (side == 1) return textureLod(side1, st, 0.0);
    if (side == 2) return textureLod(side2, st, 0.0);
    if (side == 3) return textureLod(side3, st, 0.0);
    if (side == 4) return textureLod(side4, st, 0.0);
    return textureLod(side5, st, 0.0);
}
void main() {
    vec2 share = 0.5 + 0.5 * corner;
    vec3 d = eyeForward.xyz;
    if (eyePlace.w == 0.0)
        d += mix(eyeEdges.x, eyeEdges.y, share.x) * eyeRight.xyz + mix(eyeEdges.z, eyeEdges.w, share.y) * eyeUp.xyz;
    d = normalize(mat3(localFromWorld) * d);
    // Near the axis an arc cosine knows no small angles.
    float angle = atan(length(d.xz), d.y);
    int count = textureSize(colors, 0).x;
    result = texelFetch(colors, ivec2(clamp(int(angle / kPi * float(count)), 0, count - 1), 0), 0);
    vec3 a = abs(d);
    int side;
    vec2 st;
    if (a.z >= a.x && a.z >= a.y) {
        side = d.z > 0.0 ? 1 : 0;
        st = vec2(d.z > 0.0 ? -d.x : d.x, d.y) / a.z;
    } else if (a.x >= a.y) {
        side = d.x < 0.0 ? 2 : 3;
        st = vec2(d.x < 0.0 ? -d.z : d.z, d.y) / a.x;
    } else {
        side = d.y > 0.0 ? 4 : 5;
        st = vec2(d.x, d.y > 0.0 ? d.z : -d.z) / a.y;
    }
    float there = side < 4 ? sidesFirst[side] : sidesLast[side - 4];
    if (there > 0.0) {
        vec4 texel = sideColor(side, 0.5 + 0.5 * st);
        result = vec4(texel.rgb * texel.a, texel.a) + result * (1.0 - texel.a);
    }
}
)";

const char* const kFragmentHead = R"(
uniform sampler2D tables;
uniform sampler2D baseTexture, emissiveTexture, specularTexture, normalTexture;
uniform sampler2D roughnessTexture, occlusionTexture, ambientTexture, shininessTexture;
uniform vec4 eyePlace, eyeForward, eyeRight, eyeUp, eyeLimits, eyePixels, eyeMore;
uniform vec4 thing, stroke, named;
uniform vec4 baseColor, specularColor, emissiveColor, numbers, more, hatching, mirrors;
uniform vec4 squareX, squareY, squareZ;
uniform vec4 rowS0, rowS1, rowS2, rowS3, rowS4, rowS5, rowS6, rowS7;
uniform vec4 rowT0, rowT1, rowT2, rowT3, rowT4, rowT5, rowT6, rowT7;
#ifdef STROKES
flat in vec3 startPlace, endPlace, startNormal, endNormal;
flat in vec4 startColor, endColor, ends;
flat in vec2 fogEnds;
noperspective in vec3 inPicture;
flat in float halfWidth;
vec3 place, surfaceNormal, coordinates;
vec4 color;
float depth;
#else
in vec3 place, surfaceNormal, coordinates;
in vec4 color;
in float depth;
#endif
out vec4 result;

vec4 texel(int at) { return texelFetch(tables, ivec2(at & 63, at >> 6), 0); }
vec3 encoded(vec3 light) {
    vec3 x = max(light, vec3(0.0));
    return mix(1.055 * pow(max(x, vec3(1e-8)), vec3(1.0 / 2.4)) - 0.055, 12.92 * x, lessThanEqual(x, vec3(0.0031308)));
}
vec3 decoded(vec3 shown) {
    return mix(pow((max(shown, vec3(0.0)) + 0.055) / 1.055, vec3(2.4)), shown / 12.92, lessThanEqual(shown, vec3(0.04045)));
}

// The level of a texture's copies by the area that a pixel has on it, whatever its shape.
vec4 look(sampler2D from, vec4 rowS, vec4 rowT, vec3 px, vec3 py, float cosine, float distance) {
    vec2 st = vec2(dot(rowS.xyz, vec3(coordinates.xy, 1.0)), dot(rowT.xyz, vec3(coordinates.xy, 1.0)));
    vec2 dx = dFdx(st), dy = dFdy(st);
    float inTexture = abs(dx.x * dy.y - dx.y * dy.x), inWorld = length(cross(px, py));
    float width = eyeMore.x * (eyePixels.x * distance + eyePixels.y) / sqrt(max(cosine, 0.05));
    vec2 size = vec2(textureSize(from, 0));
    float pixels = inWorld > 0.0 ? width * sqrt(inTexture / inWorld * size.x * size.y) : 0.0;
    float level = pixels > 1.0 ? log2(pixels) : 0.0;
    if (rowT.w > 0.5) level = floor(level + 0.5);
    vec4 found = textureLod(from, st, level);
    if (rowS.w > 0.5) found.rgb = encoded(found.rgb);
    return found;
}
#define LOOK(texture, s, t) look(texture, s, t, px, py, cosine, distance)
)";

const char* const kFragmentLight = R"(
struct Surface {
    vec3 normal, view, base, specular, ambient;
    float exponent, metallic, roughness, occluded;
};
// Of light from all around, what a matte surface reflects.
vec3 matte(Surface s, int first) {
    vec3 n = s.normal;
    vec3 sum = 0.282095 * texel(first).rgb + 0.488603 * (n.y * texel(first + 1).rgb + n.z * texel(first + 2).rgb + n.x * texel(first + 3).rgb);
    sum += 1.092548 * (n.x * n.y * texel(first + 4).rgb + n.y * n.z * texel(first + 5).rgb + n.x * n.z * texel(first + 7).rgb);
    sum += 0.315392 * (3.0 * n.z * n.z - 1.0) * texel(first + 6).rgb + 0.546274 * (n.x * n.x - n.y * n.y) * texel(first + 8).rgb;
    sum = max(sum, vec3(0.0));
#ifdef PHYSICAL
    return s.occluded * (1.0 - s.metallic) * 0.96 * s.base * sum;
#else
    return s.occluded * s.base * encoded(sum);
#endif
}
float powerOf(float x, float exponent) { return exponent > 0.0 ? pow(max(x, 1e-20), exponent) : 1.0; }
#ifdef PHYSICAL
vec3 physical(Surface s, vec3 towards, float cosine) {
    vec3 h = normalize(towards + s.view);
    float cosView = max(dot(s.normal, s.view), 1e-4), cosHalf = max(dot(s.normal, h), 0.0);
    float m = clamp(1.0 - max(dot(towards, h), 0.0), 0.0, 1.0), alpha = max(s.roughness * s.roughness, 1e-3);
    float a2 = alpha * alpha, d = cosHalf * cosHalf * (a2 - 1.0) + 1.0;
    float masking = cosine * sqrt(cosView * cosView * (1.0 - a2) + a2) + cosView * sqrt(cosine * cosine * (1.0 - a2) + a2);
    float specular = masking > 0.0 ? 0.5 * (a2 / (d * d)) / masking : 0.0;
    vec3 f0 = mix(vec3(0.04), s.base, s.metallic), fresnel = f0 + (1.0 - f0) * (m * m * m * m * m);
    return (1.0 - fresnel) * (1.0 - s.metallic) * s.base + fresnel * specular;
}
#endif
vec3 shine(Surface s, vec3 towards, float factor, vec3 lightColor, vec3 lightAmbient) {
    if (squareX.w > 0.0) towards = normalize(mat3(squareX.xyz, squareY.xyz, squareZ.xyz) * towards);
    float cosine = max(dot(s.normal, towards), 0.0);
#ifdef PHYSICAL
    vec3 direct = cosine > 0.0 ? physical(s, towards, cosine) * cosine * 0.318309886 : vec3(0.0);
#else
    vec3 direct = s.base * cosine;
    if (cosine > 0.0 && s.specular != vec3(0.0)) {
        vec3 h = towards + s.view;
        float along = max(dot(s.normal, h), 0.0);
        direct += s.specular * powerOf(min(along * along / max(dot(h, h), 1e-30), 1.0), 0.5 * s.exponent);
    }
#endif
    return factor * (lightColor * direct + lightAmbient * s.ambient);
}
vec3 lit(Surface s, vec4 record) {
    vec3 sum = vec3(0.0);
    int first = int(record.x), count = int(record.y);
    for (int i = 0; i < count; ++i) {
        int at = int(texel(first + i).x);
        vec4 one = texel(at), colored = texel(at + 1), ambient = texel(at + 2);
        if (one.x == 3.0) {
            sum += colored.rgb * matte(s, at + 3) + ambient.rgb * s.ambient;
            continue;
        }
        vec3 direction = texel(at + 4).xyz;
        if (one.x == 0.0) {
            sum += shine(s, -direction, 1.0, colored.rgb, ambient.rgb);
            continue;
        }
        vec3 towards = texel(at + 3).xyz - place, falling = texel(at + 5).xyz;
        float distance = length(towards), local = distance * one.z;
        towards /= max(distance, 1e-30);
        float factor = 1.0 / max(falling.x + local * (falling.y + local * falling.z), 1.0);
        if (one.y >= 0.0 && local > one.y) factor = 0.0;
        if (one.x == 2.0) {
            float angle = acos(clamp(-dot(towards, direction), -1.0, 1.0)), beam = one.w, cut = colored.w;
            if (angle >= cut) factor = 0.0;
            else if (angle > beam) factor *= (angle - cut) / (beam - cut);
        }
        if (factor > 0.0) sum += shine(s, towards, factor, colored.rgb, ambient.rgb);
    }
    if (eyeRight.w > 0.0) sum += shine(s, -eyeForward.xyz, 1.0, vec3(1.0), vec3(0.0));
    return sum;
}
)";

const char* const kFragmentMain = R"(
float onLine(float x) { return x - 8.0 * floor(x / 8.0) < 1.0 ? 1.0 : 0.0; }
float onSlope(float x) {
    float apart = 8.0 * sqrt(2.0);
    return x - apart * floor(x / apart) < sqrt(2.0) ? 1.0 : 0.0;
}
bool isHatched(float style, vec2 p) {
    if (style == 1.0) return onLine(p.y) > 0.0;
    if (style == 2.0) return onLine(p.x) > 0.0;
    if (style == 3.0) return onSlope(p.y - p.x) > 0.0;
    if (style == 4.0) return onSlope(p.y + p.x) > 0.0;
    if (style == 5.0) return onLine(p.x) + onLine(p.y) > 0.0;
    if (style == 6.0) return onSlope(p.y - p.x) + onSlope(p.y + p.x) > 0.0;
    return false;
}
#ifdef STROKES
bool isDash(float type, float pixels, float width) {
    float at = pixels / max(width, 1.0);
    if (type == 2.0) return mod(at, 12.0) < 8.0;
    if (type == 3.0) return mod(at, 6.0) < 2.0;
    float whole = type == 4.0 ? 18.0 : type == 5.0 ? 24.0 : 1.0;
    float on = mod(at, whole);
    if (type == 4.0) return on < 8.0 || (on >= 12.0 && on < 14.0);
    if (type == 5.0) return on < 8.0 || (on >= 12.0 && on < 14.0) || (on >= 18.0 && on < 20.0);
    return true;
}
#endif
void main() {
#ifdef STROKES
    float share = inPicture.z > 0.0 ? clamp(inPicture.x / inPicture.z, 0.0, 1.0) : 0.0;
    // Back from the picture: what is half way there is nearer to the nearer end.
    share = ends.x + (ends.y - ends.x) * share * ends.w / max(ends.z * (1.0 - share) + ends.w * share, 1e-30);
    place = mix(startPlace, endPlace, share);
    surfaceNormal = mix(startNormal, endNormal, share);
    color = mix(startColor, endColor, share);
    coordinates = vec3(0.0, 0.0, mix(fogEnds.x, fogEnds.y, share));
    // Nearer by a little: a line that lies in a surface is seen.
    depth = dot(place - eyePlace.xyz, eyeForward.xyz) - 0.00002 * length(place - eyePlace.xyz);
#endif
    vec3 from = place - eyePlace.xyz;
    float distance = eyePlace.w > 0.0 ? depth : length(from);
    if (depth < eyeLimits.x || depth > eyeLimits.y || distance > eyeLimits.z) discard;
    vec3 view = eyePlace.w > 0.0 ? -eyeForward.xyz : -from / max(length(from), 1e-30);
    vec3 px = dFdx(place), py = dFdy(place), facing = cross(px, py);
    facing = length(facing) > 0.0 ? normalize(facing) : view;
    float cosine = abs(dot(facing, view));
    if (dot(facing, view) < 0.0) facing = -facing;
    vec3 n = length(surfaceNormal) > 1e-12 ? normalize(surfaceNormal) : facing;
#ifdef STROKES
#ifndef POINTS
    float past = max(max(-inPicture.x, inPicture.x - inPicture.z), 0.0);
    if (past * past + inPicture.y * inPicture.y > halfWidth * halfWidth) discard;
    if (stroke.y > 1.0 && !isDash(stroke.y, share * length(endPlace - startPlace) / max(eyePixels.x * depth + eyePixels.y, 1e-20), 2.0 * halfWidth)) discard;
#endif
#else
    // Pictures that are drawn into textures are upside down, so that fronts run the other way.
    bool back = gl_FrontFacing != (thing.w < 0.0);
    if (back ? mod(floor(thing.z / 2.0), 2.0) < 1.0 : mod(thing.z, 2.0) < 1.0) discard;
    if (back) n = -n;
#endif
    vec4 record = texel(int(thing.x)), fog = texel(int(thing.x) + 1);
    int firstCut = int(record.z), cuts = int(record.w);
    for (int i = 0; i < cuts; ++i) {
        vec4 plane = texel(firstCut + i);
        if (dot(plane.xyz, place) + plane.w < 0.0) discard;
    }

    vec3 base = baseColor.rgb, emissive = emissiveColor.rgb, specular = specularColor.rgb;
    float opacity = baseColor.a, alpha = 1.0, exponent = specularColor.a, ambient = numbers.x;
    float metallic = numbers.y, roughness = numbers.z, occluded = 1.0;
    bool colored = mod(thing.y, 2.0) > 0.5, alphaColored = mod(floor(thing.y / 2.0), 2.0) > 0.5;
    bool fogged = thing.y >= 4.0;
    if (colored) {
        base = color.rgb;
        if (alphaColored) opacity = color.a;
    }
#ifdef USE0
    vec4 baseTexel = LOOK(baseTexture, rowS0, rowT0);
    base *= baseTexel.rgb;
    alpha = baseTexel.a;
#endif
    vec3 ambientBase = base;
#ifdef USE1
    emissive *= LOOK(emissiveTexture, rowS1, rowT1).rgb;
#endif
#ifdef USE2
    specular *= LOOK(specularTexture, rowS2, rowT2).rgb;
#endif
#ifdef USE6
    ambientBase *= LOOK(ambientTexture, rowS6, rowT6).rgb;
#endif
#ifdef USE7
    exponent *= LOOK(shininessTexture, rowS7, rowT7).a;
#endif
#ifdef USE4
    vec4 rough = LOOK(roughnessTexture, rowS4, rowT4);
    roughness *= rough.g;
    metallic *= rough.b;
#endif
#ifdef USE5
    occluded = 1.0 + more.y * (LOOK(occlusionTexture, rowS5, rowT5).r - 1.0);
    ambient *= occluded;
#endif
#ifdef USE3
    {
        vec3 texel = LOOK(normalTexture, rowS3, rowT3).rgb * 2.0 - 1.0;
        vec2 st = vec2(dot(rowS3.xyz, vec3(coordinates.xy, 1.0)), dot(rowT3.xyz, vec3(coordinates.xy, 1.0)));
        vec2 dx = dFdx(st), dy = dFdy(st);
        float area = dx.x * dy.y - dx.y * dy.x;
        vec3 s = (px * dy.y - py * dx.y) * sign(area), t = (py * dx.x - px * dy.x) * sign(area);
        s -= dot(s, n) * n;
        t -= dot(t, n) * n;
        if (length(s) > 0.0 && length(t) > 0.0)
            n = normalize(normalize(s) * (texel.x * more.x) + normalize(t) * (texel.y * more.x) + n * texel.z);
    }
#endif
    float coverage = clamp(alpha, 0.0, 1.0), opaque = clamp(opacity, 0.0, 1.0);
    if (more.z == 1.0) coverage = 1.0, opaque = 1.0;
    if (more.z == 2.0) coverage = alpha * opacity < numbers.w ? 0.0 : 1.0, opaque = 1.0;
#ifdef HATCHED
    {
        vec2 p = vec2(dot(from, eyeMore.yzw), dot(from, vec3(eyeLimits.w, eyeUp.w, eyeForward.w)));
        p /= eyePlace.w > 0.0 ? eyePixels.y : eyePixels.x * max(abs(depth), 1e-20);
        if (isHatched(abs(hatching.w), p)) {
            base = emissive = hatching.rgb;
#ifndef UNLIT
            base = vec3(0.0);
#endif
            specular = ambientBase = vec3(0.0);
            coverage = opaque = 1.0;
        } else if (hatching.w < 0.0) discard;
    }
#endif
    if (coverage == 0.0) discard;
    // By its logarithm: as fine at a millimetre as at a thousand kilometres.
    gl_FragDepth = log2(1.0 + max(depth, 0.0) * 1000.0) * (1.0 / 40.0);
#ifdef NUMBERS
    result = vec4(named.x, depth, 0.0, 1.0);
    return;
#endif
#ifdef UNLIT
    vec3 shown = base;
#else
    if (squareX.w > 0.0) {
        mat3 m = mat3(squareX.xyz, squareY.xyz, squareZ.xyz);
        view = normalize(m * view);
        n = normalize(mat3(cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])) * n * sign(dot(cross(m[0], m[1]), m[2])));
    }
    Surface s = Surface(n, view, base, specular, ambientBase * ambient, exponent, metallic, roughness, occluded);
    vec3 shown = emissive + lit(s, record);
#endif
#ifdef PHYSICAL
    shown = encoded(shown);
#endif
    float left = 1.0;
    vec4 fogColor = texel(int(thing.x) + 2);
    if (fog.x > 0.0) {
        vec3 fogAlong = texel(int(thing.x) + 3).xyz;
        float deep = fogAlong == vec3(0.0) ? distance : dot(fogAlong, place) - fog.z;
        if (deep >= fog.y) left = 0.0;
        else if (deep > 0.0) left = fog.x == 1.0 ? (fog.y - deep) / fog.y : exp(-deep / (fog.y - deep));
        if (fogged) left = 1.0 - clamp(coordinates.z, 0.0, 1.0);
    }
    vec3 mirrored = mirrors.rgb, own = coverage * opaque * (1.0 - mirrored);
    float passes = 1.0 - coverage + coverage * (1.0 - dot(mirrored, vec3(1.0 / 3.0))) * (1.0 - opaque);
    if (passes > 0.0) shown = min(shown, vec3(1.0));
    if (passes > 0.999) discard;
    vec3 whole = mirrored * (1.0 - opaque) + opaque;
    result = vec4(own * left * shown + coverage * whole * (1.0 - left) * fogColor.rgb, 1.0 - passes);
}
)";

std::string defines(const ProgramKey& key) {
    std::string text = "#version 330 core\n";
    const auto define = [&](bool which, const char* name) {
        if (which) text += std::string("#define ") + name + "\n";
    };
    define(key.strokes, "STROKES");
    define(key.points, "POINTS");
    define(key.hatched, "HATCHED");
    define(key.numbers, "NUMBERS");
    define(key.model == RasterModel::unlit, "UNLIT");
    define(key.model == RasterModel::physical, "PHYSICAL");
    for (std::size_t use = 0; use < kRasterUses; ++use)
        define((key.uses >> use & 1u) != 0, ("USE" + std::to_string(use)).c_str());
    return text;
}

}  // namespace

ProgramKey::ProgramKey(const RasterMaterial& material)
    : model(material.model), strokes(material.strokes), points(material.points), hatched(material.hatched) {
    for (std::size_t use = 0; use < kRasterUses; ++use)
        if (material.uses[use].texture != 0) uses |= 1u << use;
}

std::string ProgramKey::name() const {
    if (background) return "background";
    return std::to_string(static_cast<int>(model)) + (strokes ? points ? "p" : "l" : "t") + (hatched ? "h" : "-") +
           std::to_string(uses) + (numbers ? "n" : "");
}

std::string vertexProgram(const ProgramKey& key) {
    return defines(key) + (key.background ? kBackgroundVertex : key.strokes ? kStrokeVertex : kVertex);
}

std::string fragmentProgram(const ProgramKey& key) {
    if (key.background) return defines(key) + kBackgroundFragment;
    return defines(key) + kFragmentHead + kFragmentLight + kFragmentMain;
}

}  // namespace rtsg
