/* Signals of time of every kind: pieces follow each other without gaps, end at kinks, and agree where they meet. */
#include "signals/signal.h"

#include <math.h>
#include <stdbool.h>

#include "body/signal_check.h"
#include "check.h"

enum { SIGNALS = 400, MOST_PIECES = 300, ROWS = 12 };

static vi_random random_memory;
static vi_transform transform;
static double rows_time[ROWS], rows_value[ROWS], rows_bend[ROWS];

static double size(uint64_t *seed)
{
    return pow(10.0, uniform(seed, -3.0, 3.0));
}

/* A valid signal with numbers of many sizes. */
static vi_signal any_signal(uint64_t *seed)
{
    vi_signal s = {.kind = (vi_signal_kind)(1 + choice(seed, VI_TABLE_CUBIC)), .seed = next_random(seed)};
    s.start = choice(seed, 3) == 0 ? 0.0 : uniform(seed, -1.0, 1.0) * size(seed);
    s.duration = size(seed);
    s.angular_frequency = choice(seed, 5) == 0 && s.kind != VI_CHIRP_LOGARITHMIC ? 0.0 : size(seed);
    s.end_angular_frequency = choice(seed, 4) == 0 && s.kind != VI_RANDOM ? s.angular_frequency : size(seed);
    if (s.kind == VI_RANDOM) {
        s.end_angular_frequency = 1.1 * s.angular_frequency + size(seed);
    } else if (s.kind == VI_CHIRP_LOGARITHMIC && s.angular_frequency == 0.0) {
        s.angular_frequency = 1.0;
    }
    s.phase = uniform(seed, -10.0, 10.0);
    s.rise = choice(seed, 3) == 0 ? 0.0 : 0.5 * s.duration * uniform(seed, 0.0, 1.0);
    double at = uniform(seed, -1.0, 1.0);
    for (int k = 0; k < ROWS; ++k) {
        rows_time[k] = at;
        rows_value[k] = uniform(seed, -1.0, 1.0);
        at += size(seed);
    }
    const bool is_table = s.kind == VI_TABLE_LINEAR || s.kind == VI_TABLE_CUBIC;
    s.table = (vi_table){is_table ? ROWS : 0, rows_time, rows_value, NULL};
    if (s.kind == VI_TABLE_CUBIC) {
        vi_table_bend(ROWS, rows_time, rows_value, rows_bend);
        s.table.bend = rows_bend;
    }
    s.random = &random_memory;
    s.transform = &transform;
    return s;
}

static double end_of(const vi_signal *s)
{
    const bool is_table = s->kind == VI_TABLE_LINEAR || s->kind == VI_TABLE_CUBIC;
    return s->start + (is_table ? rows_time[ROWS - 1] : s->duration);
}

/* Follow the pieces from a time on; a piece that goes on has the value that the next one begins with. */
static void pieces_follow_each_other(vi_signal *s, double begin, int number)
{
    vi_twofold now = {begin, 0.0};
    vi_piece piece;
    double before = NAN;
    int jumps = 0;
    for (int n = 0; n < MOST_PIECES; ++n) {
        vi_signal_piece(s, now, &piece);
        CHECK(piece.length > 0.0, "signal %d, kind %d: length %g", number, (int)s->kind, piece.length);
        CHECK(piece.degree >= 0 && piece.degree <= VI_PIECE_DEGREE, "signal %d: degree %d", number, piece.degree);
        for (int k = 0; k <= piece.degree; ++k) {
            CHECK(isfinite(piece.coefficient[k]), "signal %d: coefficient %d", number, k);
        }
        jumps += fabs(piece.coefficient[0] - before) > 1e-7 ? 1 : 0;
        if (!(piece.length < HUGE_VAL)) {
            CHECK(piece.degree == 0 && piece.coefficient[0] == 0.0, "signal %d: not 0 at its end", number);
            CHECK(fabs(now.high - end_of(s)) <= 1e-14 * (fabs(s->start) + fabs(end_of(s))) || begin > end_of(s),
                  "signal %d ends at %.17g, not at %.17g", number, now.high, end_of(s));
            break;
        }
        before = 0.0;
        for (int n = piece.degree; n >= 0; --n) {
            before = before * piece.length + piece.coefficient[n];
        }
        now = vi_twofold_sum(now, (vi_twofold){piece.length, 0.0});
    }
    CHECK(jumps <= 2, "signal %d, kind %d: %d jumps", number, (int)s->kind, jumps);
}

static void test_any_signal(uint64_t *seed, int number)
{
    char message[VI_MESSAGE_LENGTH] = "";
    vi_signal s = any_signal(seed);
    vi_check_signal(message, "signal[1]", &s);
    CHECK(message[0] == '\0', "signal %d: %s", number, message);
    vi_signal_prepare(&s);
    pieces_follow_each_other(&s, s.start - size(seed), number);
    pieces_follow_each_other(&s, s.start + uniform(seed, 0.0, 1.0) * (end_of(&s) - s.start), number);
    pieces_follow_each_other(&s, end_of(&s) - 1e-9 * fabs(end_of(&s)), number);
}

/* A transform there and back is the same, and a wave has one frequency. */
static void test_transform(uint64_t *seed)
{
    static double real[VI_TRANSFORM_ROOM], imaginary[VI_TRANSFORM_ROOM], kept[VI_TRANSFORM_ROOM];
    for (int n = 4; n <= VI_TRANSFORM_ROOM; n *= 2) {
        vi_transform_prepare(&transform, n);
        const int wave = (int)choice(seed, (unsigned)n);
        for (int j = 0; j < n; ++j) {
            const double angle = 6.283185307179586 * (double)((int64_t)wave * j % n) / (double)n;
            kept[j] = real[j] = cos(angle);
            imaginary[j] = sin(angle);
        }
        vi_transform_forward(&transform, n, real, imaginary);
        for (int j = 0; j < n; ++j) {
            const int place = vi_transform_place(n, j);
            const double expected = j == wave ? (double)n : 0.0;
            CHECK(fabs(real[place] - expected) + fabs(imaginary[place]) < 1e-11 * (double)n, "size %d: %g + %g i at %d", n,
                  real[place], imaginary[place], j);
        }
        vi_transform_backward(&transform, n, real, imaginary);
        for (int j = 0; j < n; ++j) {
            CHECK(fabs(real[j] / (double)n - kept[j]) < 1e-14, "size %d: %g at %d", n, real[j] / (double)n, j);
        }
    }
}

static void test_numbers_that_are_none(void)
{
    static const double none[] = {NAN, HUGE_VAL, -HUGE_VAL, -1.0, 0.0};
    for (int kind = VI_CHIRP_LINEAR; kind <= VI_TABLE_CUBIC + 1; ++kind) {
        for (int k = 0; k < 5; ++k) {
            char message[VI_MESSAGE_LENGTH] = "";
            const double bad[2] = {0.0, none[k]}, good[2] = {0.0, 1.0};
            const vi_signal s = {.kind = (vi_signal_kind)kind, .duration = none[k], .rise = none[k],
                                 .angular_frequency = none[k], .end_angular_frequency = none[k],
                                 .table = {2, bad, good, NULL}};
            vi_check_signal(message, "signal[1]", &s);
            CHECK(message[0] != '\0', "kind %d takes %g", kind, none[k]);
        }
    }
}

int main(void)
{
    uint64_t seed = 8;
    test_transform(&seed);
    test_numbers_that_are_none();
    for (int number = 0; number < SIGNALS; ++number) {
        test_any_signal(&seed, number);
    }
    return 0;
}
