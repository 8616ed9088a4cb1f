#include "signals/random.h"

#include <string.h>

#include "measuring/gaussian.h"

static const double PI = 3.141592653589793116;

/* Instants of the spline in the shortest period. The first image of a frequency w lies at 7 w or above. Its power is
 * below (1/7)^8 = 1.7e-7 of the density at w. */
static const double INSTANTS_PER_PERIOD = 8.0;

/* Kaiser's window with 70 dB: the response is right to 3e-4 of the largest one. Edges of the density become slopes of
 * EDGE / size times the upper end of the band. */
static const double KAISER = 6.755;
static const double EDGE = 69.1;
enum { BESSEL_TERMS = 20 };

/* Edges may take this part of the narrowest interval of the density. */
static const double EDGE_PART = 0.25;

/* Channel of the counters; noise of measurements with the same seed has another one. */
static const uint64_t CHANNEL = UINT64_C(0x466f726365730000);

/* Coefficients that blocks have in common: an interval of the spline needs one before it and two after it. One more makes
 * the number even, for white numbers come in pairs. */
enum { NEIGHBOURS = 4 };

/* ---- the density ---- */

/* The density at w within the band; *place: index of an interval at or before that of w, which is moved on. */
static double density_at(const vi_density *density, double w, int *place)
{
    const vi_table *table = &density->density;
    if (w < density->low || w > density->high) {
        return 0.0;
    }
    if (table->count == 0) {
        return 1.0 / (density->high - density->low);
    }
    while (*place + 2 < table->count && table->time[*place + 1] <= w) {
        *place += 1;
    }
    const double *at = table->time + *place, *value = table->value + *place;
    const double part = (w - at[0]) / (at[1] - at[0]);
    return fmax(0.0, value[0] + part * (value[1] - value[0]));
}

double vi_density_variance(const vi_density *density)
{
    const vi_table *table = &density->density;
    if (table->count == 0) {
        return 1.0;
    }
    int place = 0;
    double from = density->low, value = density_at(density, from, &place), sum = 0.0;
    for (int k = 0; k < table->count + 1; ++k) {
        const double next = k < table->count ? table->time[k] : density->high;
        const double to = fmin(next, density->high);
        if (to > from) {
            const double last = density_at(density, to, &place);
            sum += 0.5 * (to - from) * (value + last);
            from = to;
            value = last;
        }
    }
    return sum;
}

/* Narrowest interval between two ends of slopes of the density within the band, rad/s, the distance from 0 included. */
static double narrowest(const vi_density *density)
{
    double from = density->low, least = density->high - density->low;
    if (from > 0.0) {
        least = fmin(least, from);
    }
    for (int k = 0; k < density->density.count; ++k) {
        const double to = density->density.time[k];
        if (to > from && to < density->high) {
            least = fmin(least, fmin(to - from, density->high - to));
            from = to;
        }
    }
    return least;
}

/* Size of a block whose filter resolves the density, as far as sizes go. */
static int size_for(const vi_density *density)
{
    const double most = EDGE_PART * narrowest(density);
    int size = VI_RANDOM_LEAST;
    while (size < VI_TRANSFORM_ROOM && EDGE * density->high > most * (double)size) {
        size *= 2;
    }
    return size;
}

/* ---- the filter ---- */

/* The response of a filter of any length at frequency j of a transform: sqrt(S pi / interval) over that of the spline,
 * sinc(w interval / 2)^4. */
static double response_at(const vi_random *r, const vi_transform *transform, const vi_density *density, int j,
                          int *place)
{
    const double part = (double)j / (double)r->size, w = 2.0 * PI * part / r->interval;
    const double value = density_at(density, w, place);
    if (!(value > 0.0)) {
        return 0.0;
    }
    /* sin(x / 2)^2 = sin(x)^2 / (2 + 2 cos(x)) */
    const double *const cosine = transform->cosine + r->size / 2, *const sine = transform->sine + r->size / 2;
    const double sinc = j > 0 ? sine[j] / (PI * part) : 1.0;
    const double square = j > 0 ? sinc * sinc / (2.0 + 2.0 * cosine[j]) : 1.0;
    return sqrt(value * PI / r->interval) / (square * square);
}

/* Modified Bessel function of order 0 of 2 sqrt(x) by its series, to rounding for arguments up to KAISER. */
static double bessel(double x)
{
    double sum = 1.0, term = 1.0;
    for (int k = 1; k <= BESSEL_TERMS; ++k) {
        term *= x / (double)(k * k);
        sum += term;
    }
    return sum;
}

/* Limit the filter to size / 2 + 1 numbers, from its response in first[] to that in first[]; second[] is work. */
static void limit(vi_random *r, const vi_transform *transform)
{
    const int size = r->size, reach = size / 4;
    memset(r->second, 0, (size_t)size * sizeof r->second[0]);
    vi_transform_backward(transform, size, r->first, r->second);
    const double most = 0.25 * KAISER * KAISER, top = bessel(most) * (double)size;
    for (int n = 0; n <= size / 2; ++n) {
        const double part = (double)n / (double)reach;
        const double factor = n <= reach ? bessel(most * (1.0 - part) * (1.0 + part)) / top : 0.0;
        r->first[n] *= factor;
        if (n > 0) {
            r->first[size - n] = r->first[n];
        }
    }
    memset(r->second, 0, (size_t)size * sizeof r->second[0]);
    vi_transform_forward(transform, size, r->first, r->second);
}

/* Variance of the spline, averaged over time, for the response in first[]. The images of a B-spline add up to a sum of
 * cosines of w interval. */
static double variance(const vi_random *r, const vi_transform *transform)
{
    const int half = r->size / 2;
    double sum = 0.0;
    for (int j = 0; j <= half; ++j) {
        const double response = r->first[vi_transform_place(r->size, j)];
        const double once = j < half ? transform->cosine[half + j] : -1.0;
        const double twice = 2.0 * once * once - 1.0, thrice = (4.0 * once * once - 3.0) * once;
        const double images = (2416.0 + 2382.0 * once + 240.0 * twice + 2.0 * thrice) / 5040.0;
        sum += (j > 0 && j < half ? 2.0 : 1.0) * response * response * images;
    }
    return sum / (double)r->size;
}

void vi_random_shape(vi_random *r, vi_transform *transform, const vi_density *density)
{
    r->size = size_for(density);
    r->known = false;
    r->interval = 2.0 * PI / (INSTANTS_PER_PERIOD * density->high);
    vi_transform_prepare(transform, r->size);
    int at = 0;
    for (int j = 0; j <= r->size / 2; ++j) {
        const double response = response_at(r, transform, density, j, &at);
        r->first[vi_transform_place(r->size, j)] = response;
        if (j > 0) {
            r->first[vi_transform_place(r->size, r->size - j)] = response;
        }
    }
    limit(r, transform);
    const double scale = sqrt(vi_density_variance(density) / variance(r, transform)) / (double)r->size;
    for (int k = 0; k < r->size; ++k) {
        r->filter[k] = r->first[k] * scale;
    }
}

/* ---- blocks ---- */

/* Intervals of the spline that a block serves. */
static int64_t advance(const vi_random *r)
{
    return r->size - NEIGHBOURS;
}

/* Shape white numbers into the coefficients from `block * advance - 2` on. One transform shapes two stretches, as its
 * real and its imaginary part; a quarter at each end is lost to the filter. */
static void make(vi_random *r, const vi_transform *transform, uint64_t seed, int64_t block)
{
    const int size = r->size;
    const int64_t begin = block * advance(r) - 2 - size / 4; /* even */
    for (int n = 0; n < size; n += 2) {
        vi_gaussian_pair(seed, CHANNEL, (uint64_t)((begin + n) / 2), r->first + n);
    }
    memcpy(r->second, r->first + size / 2, (size_t)(size / 2) * sizeof r->second[0]);
    for (int n = size / 2; n < size; n += 2) {
        vi_gaussian_pair(seed, CHANNEL, (uint64_t)((begin + size / 2 + n) / 2), r->second + n);
    }
    vi_transform_forward(transform, size, r->first, r->second);
    for (int k = 0; k < size; ++k) {
        r->first[k] *= r->filter[k];
        r->second[k] *= r->filter[k];
    }
    vi_transform_backward(transform, size, r->first, r->second);
    r->block = block;
    r->known = true;
}

/* Coefficient n of the block in memory. */
static double coefficient_at(const vi_random *r, int64_t n)
{
    const int64_t half = r->size / 2, quarter = r->size / 4;
    return n < half ? r->first[quarter + n] : r->second[quarter + n - half];
}

/* Number of the spline's interval at `since`, and the seconds since its start. */
static int64_t interval_at(const vi_random *r, vi_twofold since, double resolution, double *passed)
{
    double number = floor(since.high / r->interval);
    double rest = fma(-number, r->interval, since.high) + since.low;
    if (rest < 0.0) {
        number -= 1.0;
        rest += r->interval;
    }
    if (rest >= r->interval - resolution) {
        number += 1.0;
        rest = 0.0;
    }
    *passed = fmax(rest, 0.0);
    return (int64_t)fmax(number, 0.0);
}

bool vi_random_is_knot(const vi_random *r, vi_twofold since, double resolution, int64_t *interval)
{
    double passed;
    *interval = interval_at(r, since, resolution, &passed);
    return passed <= resolution;
}

int vi_random_coefficients(vi_random *r, const vi_transform *transform, uint64_t seed, int64_t interval, int most,
                           double coefficient[])
{
    const int64_t block = interval / advance(r), n = interval - block * advance(r);
    const int64_t left = advance(r) - n, count = left < most ? left : most;
    if (!r->known || r->block != block) {
        make(r, transform, seed, block);
    }
    for (int64_t i = 0; i < count + VI_SPLINE_ORDER - 1; ++i) {
        coefficient[i] = coefficient_at(r, n + 1 + i);
    }
    return (int)count;
}

void vi_random_polynomial(const vi_random *r, const double coefficient[VI_SPLINE_ORDER], double power[VI_SPLINE_ORDER])
{
    const double a = coefficient[0], b = coefficient[1], c = coefficient[2], d = coefficient[3];
    const double each = 1.0 / r->interval;
    power[0] = (a + 4.0 * b + c) / 6.0;
    power[1] = 0.5 * (c - a) * each;
    power[2] = 0.5 * ((a - 2.0 * b) + c) * each * each;
    power[3] = (d - a + 3.0 * (b - c)) / 6.0 * each * each * each;
}

void vi_random_piece(vi_random *r, const vi_transform *transform, uint64_t seed, vi_twofold since, double resolution,
                     vi_piece *piece)
{
    double passed, coefficient[VI_SPLINE_ORDER];
    const int64_t interval = interval_at(r, since, resolution, &passed);
    (void)vi_random_coefficients(r, transform, seed, interval, 1, coefficient);
    *piece = (vi_piece){.degree = VI_SPLINE_ORDER - 1, .length = r->interval - passed};
    vi_random_polynomial(r, coefficient, piece->coefficient);
    vi_piece_shift(piece, passed);
}
