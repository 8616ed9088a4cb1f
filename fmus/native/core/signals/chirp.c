#include "signals/chirp.h"

#include <math.h>

static const vi_twofold TWO_PI = {6.283185307179586232, 2.449293598294706414e-16};

/* (17! 1e-13)^(1/17): a derivative of order 17 up to c^17 leaves a remainder of 1e-13 after 1.2337 / c. */
static const double REACH = 1.2337;

/* Coefficients of (exp(z) - 1) / z: 1 / (n + 1)! to 32 digits. Up to z = SERIES_END the next one is below 1e-33. */
static const double SERIES_END = 0.5;
static const vi_twofold SERIES[] = {
    {1.0, 0.0}, {0.5, 0.0}, {0.16666666666666666, 9.25185853854297e-18},
    {0.041666666666666664, 2.3129646346357427e-18}, {0.008333333333333333, 1.1564823173178714e-19},
    {0.001388888888888889, -5.300543954373577e-20}, {0.0001984126984126984, 1.7209558293420705e-22},
    {2.48015873015873e-05, 2.1511947866775882e-23}, {2.7557319223985893e-06, -1.858393274046472e-22},
    {2.755731922398589e-07, 2.3767714622250297e-23}, {2.505210838544172e-08, -1.448814070935912e-24},
    {2.08767569878681e-09, -1.20734505911326e-25}, {1.6059043836821613e-10, 1.2585294588752098e-26},
    {1.1470745597729725e-11, 2.0655512752830745e-28}, {7.647163731819816e-13, 7.03872877733453e-30},
    {4.779477332387385e-14, 4.399205485834081e-31}, {2.8114572543455206e-15, 1.6508842730861433e-31},
    {1.5619206968586225e-16, 1.1910679660273754e-32}, {8.22063524662433e-18, 2.2141894119604265e-34},
    {4.110317623312165e-19, 1.4412973378659527e-36}, {1.9572941063391263e-20, -1.3643503830087908e-36},
    {8.896791392450574e-22, -7.911402614872376e-38}, {3.868170170630684e-23, -8.843177655482344e-40},
    {1.6117375710961184e-24, -3.6846573564509766e-41}, {6.446950284384474e-26, -1.9330404233703465e-42}
};
enum { SERIES_TERMS = sizeof SERIES / sizeof SERIES[0] };

static vi_twofold twofold(double number)
{
    return (vi_twofold){number, 0.0};
}

/* (exp(z) - 1) / z to 32 digits; z is halved until the series takes it. */
static vi_twofold grown(vi_twofold z)
{
    int halvings = 0;
    vi_twofold y = z, sum = SERIES[SERIES_TERMS - 1];
    for (; fabs(y.high) > SERIES_END; ++halvings) {
        y = (vi_twofold){0.5 * y.high, 0.5 * y.low};
    }
    for (int n = SERIES_TERMS - 2; n >= 0; --n) {
        sum = vi_twofold_sum(vi_twofold_product(sum, y), SERIES[n]);
    }
    if (halvings == 0) {
        return sum;
    }
    vi_twofold growth = vi_twofold_product(sum, y); /* exp(y) - 1 */
    for (int n = 0; n < halvings; ++n) {
        growth = vi_twofold_product(growth, vi_twofold_sum(growth, twofold(2.0)));
    }
    return vi_twofold_quotient(growth, z);
}

/* The natural logarithm of x > 0 to 32 digits: one step of Newton's method from the rounded one. */
static vi_twofold logarithm(vi_twofold x)
{
    const vi_twofold first = twofold(log(x.high)), back = twofold(-first.high);
    const vi_twofold shrunk = vi_twofold_sum(vi_twofold_product(grown(back), back), twofold(1.0));
    const vi_twofold off = vi_twofold_difference(vi_twofold_product(x, shrunk), twofold(1.0));
    return vi_twofold_sum(first, vi_twofold_sum(off, twofold(-0.5 * off.high * off.high)));
}

vi_chirp vi_chirp_of(bool logarithmic, double phase, double angular_frequency, double end_angular_frequency,
                     double duration)
{
    const vi_twofold first = twofold(angular_frequency), last = twofold(end_angular_frequency);
    const vi_twofold change =
        logarithmic ? logarithm(vi_twofold_quotient(last, first)) : vi_twofold_difference(last, first);
    return (vi_chirp){logarithmic, phase, angular_frequency, vi_twofold_quotient(change, twofold(duration))};
}

/* A phase in [-pi, pi] that differs from another by whole turns. */
static vi_twofold reduced(vi_twofold phase)
{
    const vi_twofold turns = twofold(nearbyint(phase.high / TWO_PI.high));
    return vi_twofold_difference(phase, vi_twofold_product(turns, TWO_PI));
}

/* cos and sin of phi(t) as Taylor series: E' = i phi' E for E = exp(i phi). speed[]: coefficients of phi'. */
static void expand(vi_twofold phase, const double speed[], int speeds, vi_piece *piece)
{
    double *cosine = piece->coefficient, sine[VI_PIECE_DEGREE + 1];
    const double c = cos(phase.high), s = sin(phase.high);
    cosine[0] = c - phase.low * s;
    sine[0] = s + phase.low * c;
    for (int n = 0; n < VI_PIECE_DEGREE; ++n) {
        double real = 0.0, imaginary = 0.0;
        for (int k = 0; k <= n && k < speeds; ++k) {
            real -= speed[k] * sine[n - k];
            imaginary += speed[k] * cosine[n - k];
        }
        cosine[n + 1] = real / ((double)n + 1.0);
        sine[n + 1] = imaginary / ((double)n + 1.0);
    }
    piece->degree = VI_PIECE_DEGREE;
}

/* Seconds for which the series is exact, for phi'' = rate: |derivative 17| <= c^17, c^2 = w c + 16 |rate|. */
static double linear_reach(double w, double rate)
{
    const double spread = 64.0 * fabs(rate);
    const double first = 2.0 * REACH / (w + sqrt(w * w + spread)); /* with the frequency at the start */
    const double highest = w + fabs(rate) * first;
    return 2.0 * REACH / (highest + sqrt(highest * highest + spread));
}

/* The same for phi' = w exp(rate t): |derivative 17| is at most the product of w + k |rate|, k = 0 to 16. */
static double logarithmic_reach(double w, double rate)
{
    const double spread = 8.0 * fabs(rate), first = REACH / (w + spread);
    return REACH / (w * exp(fmax(rate, 0.0) * first) + spread);
}

void vi_chirp_piece(const vi_chirp *chirp, vi_twofold since, double length, vi_piece *piece)
{
    const double rate = chirp->rate.high;
    const vi_twofold turned = vi_twofold_product(chirp->rate, since);
    vi_twofold passed = vi_twofold_product(twofold(chirp->angular_frequency), since);
    double speed[VI_PIECE_DEGREE + 1], reach;
    int speeds = 2;
    if (chirp->logarithmic) {
        const vi_twofold growth = grown(turned);
        passed = vi_twofold_product(passed, growth);
        speed[0] = chirp->angular_frequency * (1.0 + turned.high * growth.high);
        for (speeds = 1; speeds <= VI_PIECE_DEGREE; ++speeds) {
            speed[speeds] = speed[speeds - 1] * rate / (double)speeds;
        }
        reach = logarithmic_reach(speed[0], rate);
    } else {
        const vi_twofold half = vi_twofold_product(turned, since);
        passed = vi_twofold_sum(passed, (vi_twofold){0.5 * half.high, 0.5 * half.low});
        speed[0] = chirp->angular_frequency + turned.high;
        speed[1] = rate;
        reach = linear_reach(fabs(speed[0]), rate);
    }
    expand(reduced(vi_twofold_sum(passed, twofold(chirp->phase))), speed, speeds, piece);
    piece->length = fmin(length, reach);
}
