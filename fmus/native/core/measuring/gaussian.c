#include "measuring/gaussian.h"

#include <math.h>

#include "measuring/philox.h"

/* Rational functions of Wichura's Algorithm AS 241: the percentage points of the normal distribution, Applied
 * Statistics 37 (1988); right to 1e-16. Numerators and denominators from the highest power on. */
enum { TERMS = 8 };
static const double MIDDLE[2][TERMS] = {
    {2.5090809287301226727e+3, 3.3430575583588128105e+4, 6.7265770927008700853e+4, 4.5921953931549871457e+4,
     1.3731693765509461125e+4, 1.9715909503065514427e+3, 1.3314166789178437745e+2, 3.3871328727963666080e+0},
    {5.2264952788528545610e+3, 2.8729085735721942674e+4, 3.9307895800092710610e+4, 2.1213794301586595867e+4,
     5.3941960214247511077e+3, 6.8718700749205790830e+2, 4.2313330701600911252e+1, 1.0}};
static const double TAIL[2][TERMS] = {
    {7.74545014278341407640e-4, 2.27238449892691845833e-2, 2.41780725177450611770e-1, 1.27045825245236838258e+0,
     3.64784832476320460504e+0, 5.76949722146069140550e+0, 4.63033784615654529590e+0, 1.42343711074968357734e+0},
    {1.05075007164441684324e-9, 5.47593808499534494600e-4, 1.51986665636164571966e-2, 1.48103976427480074590e-1,
     6.89767334985100004550e-1, 1.67638483018380384940e+0, 2.05319162663775882187e+0, 1.0}};
static const double FAR_TAIL[2][TERMS] = {
    {2.01033439929228813265e-7, 2.71155556874348757815e-5, 1.24266094738807843860e-3, 2.65321895265761230930e-2,
     2.96560571828504891230e-1, 1.78482653991729133580e+0, 5.46378491116411436990e+0, 6.65790464350110377720e+0},
    {2.04426310338993978564e-15, 1.42151175831644588870e-7, 1.84631831751005468180e-5, 7.86869131145613259100e-4,
     1.48753612908506148525e-2, 1.36929880922735805310e-1, 5.99832206555887937690e-1, 1.0}};

static const double LN2 = 0.69314718055994530942;
static const double ROOT_HALF = 0.70710678118654752440;

static double ratio(const double terms[2][TERMS], double x)
{
    double above = terms[0][0], below = terms[1][0];
    for (int k = 1; k < TERMS; ++k) {
        above = above * x + terms[0][k];
        below = below * x + terms[1][k];
    }
    return above / below;
}

/* Natural logarithm of a normal number by the series of artanh, since C libraries differ between machines. */
static double logarithm(double x)
{
    int exponent;
    double part = frexp(x, &exponent);
    if (part < ROOT_HALF) {
        part *= 2.0;
        exponent -= 1;
    }
    const double s = (part - 1.0) / (part + 1.0), square = s * s;
    double sum = 0.0;
    for (int k = 23; k >= 1; k -= 2) { /* square < .0295: the next term is below 1e-17 of the sum */
        sum = sum * square + 1.0 / (double)k;
    }
    return (double)exponent * LN2 + 2.0 * s * sum;
}

double vi_gaussian_quantile(int64_t j)
{
    const double q = ((double)j + 0.5) * 0x1p-53; /* exact, and so is 1/2 - |q| */
    if (fabs(q) <= 0.425) {
        return q * ratio(MIDDLE, 0.180625 - q * q);
    }
    const double r = sqrt(-logarithm(0.5 - fabs(q)));
    const double size = r <= 5.0 ? ratio(TAIL, r - 1.6) : ratio(FAR_TAIL, r - 5.0);
    return q < 0.0 ? -size : size;
}

/* The number of 53 bits of a counter. */
static double number_of(uint32_t high, uint32_t low)
{
    const uint64_t whole = ((uint64_t)high << 32 | low) >> 11;
    return vi_gaussian_quantile((int64_t)whole - (INT64_C(1) << 52));
}

static void bits_of(uint64_t seed, uint64_t channel, uint64_t index, uint32_t bits[4])
{
    bits[0] = (uint32_t)index;
    bits[1] = (uint32_t)(index >> 32);
    bits[2] = (uint32_t)channel;
    bits[3] = (uint32_t)(channel >> 32);
    vi_philox(bits, (uint32_t)seed, (uint32_t)(seed >> 32));
}

double vi_gaussian(uint64_t seed, uint64_t channel, uint64_t index)
{
    uint32_t bits[4];
    bits_of(seed, channel, index, bits);
    return number_of(bits[1], bits[0]);
}

void vi_gaussian_pair(uint64_t seed, uint64_t channel, uint64_t index, double pair[2])
{
    uint32_t bits[4];
    bits_of(seed, channel, index, bits);
    pair[0] = number_of(bits[1], bits[0]);
    pair[1] = number_of(bits[3], bits[2]);
}
