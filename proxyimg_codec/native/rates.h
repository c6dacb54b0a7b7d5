// Bits of latents under the mixture of two Laplace distributions, with derivatives; the judge is
// encoder/pyramid/rate.py, which has the formulas. Vectors of positions.
#pragma once

#include <cmath>

#include "rows.h"

namespace PXI_LEVEL {

// e**x within 2e-7 of its size; 0 below -87, and no more than e**87.
static inline vec exponential(vec x) {
    const ints low = x < -87.f;
    x = least(most(x, all(-87.f)), all(87.f));
    const vec scaled = x * 1.44269504f;
    const ints whole = __builtin_convertvector(scaled + chosen(scaled < 0.f, all(-.5f), all(.5f)), ints);
    const vec n = __builtin_convertvector(whole, vec);
    const vec r = (x - n * .693359375f) + n * 2.12194440e-4f;
    vec p = all(1.9875691500e-4f);  // Cephes, expf
    for (float c : {1.3981999507e-3f, 8.3334519073e-3f, 4.1665795894e-2f, 1.6666665459e-1f, 5.0000001201e-1f})
        p = p * r + c;
    p = p * (r * r) + r + 1.f;
    return chosen(low, (vec){}, p * (vec)((whole + 127) << 23));
}

// Natural logarithm of x > 0, a normal number.
static inline vec logarithm(vec x) {
    const ints bits = (ints)x;
    const ints e = ((bits - 0x3f3504f3) >> 23);  // so that the mantissa is in sqrt(1/2) .. sqrt(2)
    const vec m = (vec)(bits - (e << 23)) - 1.f, z = m * m;
    vec p = all(7.0376836292e-2f);  // Cephes, logf
    for (float c : {-1.1514610310e-1f, 1.1676998740e-1f, -1.2420140846e-1f, 1.4249322787e-1f, -1.6668057665e-1f,
                    2.0000714765e-1f, -2.4999993993e-1f, 3.3333331174e-1f})
        p = p * m + c;
    const vec n = __builtin_convertvector(e, vec);
    return p * m * z - z * .5f + m + n * .693147181f;
}

struct Rate {  // bits of n, of n - 1 and n + 1, and the derivatives of the first by n and by the log scale
    vec here, below, above, slope, by_scale;
};

static inline Rate rate_of(vec value, vec mean, vec log_scale) {
    const float TAIL = .125f, RATIO = 2.718281828f, PER_BIT = 1.44269504f;
    const vec offset = value - mean, distance = absolute(offset), rate = exponential(-log_scale);
    // Of both parts, e**-|z| at z = distance + k / 2 is e**-distance times powers of e**-1/2; where z is
    // negative, the powers divide.
    const vec slow = rate * (1 / RATIO);
    vec whole[2] = {exponential(-distance * rate), exponential(-distance * slow)};
    const vec half[2] = {exponential(rate * -.5f), exponential(slow * -.5f)};
    vec survival[4], density[4];
    for (int k = 0; k < 4; k++) {
        const ints inner = distance + (k - 1.5f) < 0.f;  // within the distribution's other half
        vec part[2];
        for (int i = 0; i < 2; i++) {
            const vec power = k % 3 ? half[i] : half[i] * half[i] * half[i];
            const vec whole_i = most(whole[i], all(1e-37f)), power_i = most(power, all(1e-37f));
            part[i] = k >= 2 ? whole[i] * power
                             : chosen(inner, power, whole[i]) / chosen(inner, whole_i, power_i);
            part[i] *= i ? TAIL / 2 : (1 - TAIL) / 2;
        }
        const vec tail = part[0] + part[1];
        survival[k] = chosen(inner, 1.f - tail, tail);
        density[k] = (part[0] + part[1] * (1 / RATIO)) * rate;
    }
    vec bits[3], share;
    for (int k = 0; k < 3; k++) {
        const vec p = most(survival[k] - survival[k + 1], all(1e-6f));
        if (k == 1) share = PER_BIT / p;
        bits[k] = logarithm(p) * -PER_BIT;
    }
    const ints up = offset >= 0.f;
    const vec slope = (density[1] - density[2]) * share;
    const vec spread = (density[2] * (distance + .5f) - density[1] * (distance - .5f)) * share;
    return {bits[1], chosen(up, bits[0], bits[2]), chosen(up, bits[2], bits[0]), chosen(up, slope, -slope), spread};
}

}  // namespace PXI_LEVEL
