/* Local segments of several modes begun together equal those of single modes to the last bit, and so do their parts. At
 * their start and end they agree with the given displacement and velocity. */
#include "motion/flow.h"

#include <math.h>
#include <string.h>

#include "check.h"
#include "motion/mode_series.h"

enum { MOST = 20 };

static void draw_mode(uint64_t *seed, vi_mode *mode)
{
    const double mass = uniform(seed, 0.1, 3.0), stiffness = choice(seed, 8) ? exp(uniform(seed, -6.0, 14.0)) : 0.0;
    const double ratios[] = {0.0, 1.0, uniform(seed, 0.0, 0.5), uniform(seed, 1.0, 4.0)};
    const double damping = 2.0 * ratios[choice(seed, 4)] * sqrt(mass * stiffness);
    vi_mode_start(mode, mass, damping, stiffness, choice(seed, 4) ? uniform(seed, -2.0, 2.0) : 0.0,
                  choice(seed, 4) ? uniform(seed, 0.1, 5.0) : 0.0);
}

/* Parts of modes side by side end at the first mode that is no series, and at the last whole group. */
static void check_parts(uint64_t *seed, vi_segment segments[], int count, double length)
{
    vi_part parts[MOST], alone;
    const int split = choice(seed, 4) ? count : (int)choice(seed, (unsigned)count);
    const double u = uniform(seed, 0.0, 1.0) * length;
    if (split < count) {
        segments[split].series = false;
    }
    const int done = vi_series_parts(segments, count, u, parts);
    CHECK(done <= split && split - done < 4, "%d of %d modes, split at %d", done, count, split);
    for (int j = 0; j < done; ++j) {
        vi_segment_part(&segments[j], u, &alone);
        CHECK(memcmp(&alone, &parts[j], sizeof alone) == 0, "part of mode %d of %d", j, count);
    }
}

int main(void)
{
    uint64_t seed = 7;
    for (int n = 0; n < 20000; ++n) {
        static vi_segment together[MOST], alone;
        vi_mode mode[MOST];
        double x[MOST], v[MOST], held[MOST], held_rate[MOST];
        const int count = 1 + (int)choice(&seed, MOST);
        const vi_phase phase = vi_phase_of(uniform(&seed, 0.0, 6.3));
        const double length = exp(uniform(&seed, -12.0, 2.0));
        for (int j = 0; j < count; ++j) {
            draw_mode(&seed, &mode[j]);
            x[j] = uniform(&seed, -1.0, 1.0);
            v[j] = uniform(&seed, -1.0, 1.0);
            held[j] = choice(&seed, 2) ? uniform(&seed, -1.0, 1.0) : 0.0;
            held_rate[j] = choice(&seed, 2) ? uniform(&seed, -1.0, 1.0) : 0.0;
        }
        memset(together, 0, sizeof together);
        const vi_drive drive = {.phase = phase, .held = held, .held_rate = held_rate, .degree = 1};
        vi_segments_start_local(together, mode, count, x, v, &drive, length);
        for (int j = 0; j < count; ++j) {
            memset(&alone, 0, sizeof alone);
            vi_segment_start(&alone, &mode[j], x[j], v[j], phase, held[j], held_rate[j], length, true);
            CHECK(memcmp(&alone, &together[j], sizeof alone) == 0, "mode %d of %d, case %d", j, count, n);
            vi_part start, near, end;
            vi_segment_part(&alone, 0.0, &start);
            vi_segment_part(&alone, 0x1p-1000, &near);
            CHECK(start.x == 0.0 && start.v == v[j], "%g, %g", start.x, start.v);
            CHECK(fabs(near.v - start.v) + fabs(near.a - start.a) + fabs(near.j - start.j) < 1e-280, "mode %d, case %d", j, n);
            double q, p;
            vi_segment_part(&alone, alone.length, &end);
            vi_segment_end(&alone, alone.length, phase, NULL, &q, &p);
            CHECK(q == x[j] + end.x && p == end.v, "mode %d, case %d", j, n);
        }
        check_parts(&seed, together, count, length);
    }
    return 0;
}
