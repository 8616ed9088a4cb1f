#include "motion/ripple.h"

/* Ratio of bounds above which leaving a part out is tried; each trial costs a step's arithmetic. */
static const double WORTH_A_TRIAL = 3.0;

double vi_rippling_step(const vi_part sum[], const double ripple[], int n, double offset, double sign, double horizon)
{
    vi_approach approach = vi_part_approach(&sum[n], offset, sign);
    approach.clearance = vi_max(0.0, approach.clearance);
    double best = vi_certified_step(&approach, horizon), tried = approach.bound, left_out = 0.0;
    for (int m = n - 1; m >= 0 && best < horizon; --m) {
        left_out += ripple[m];
        if (!(WORTH_A_TRIAL * sum[m].snap_bound < tried)) {
            continue;
        }
        approach = vi_part_approach(&sum[m], offset, sign);
        approach.clearance -= left_out;
        if (!(approach.clearance > 0.0)) {
            break;
        }
        tried = approach.bound;
        best = vi_max(best, vi_certified_step(&approach, horizon));
    }
    return best;
}
