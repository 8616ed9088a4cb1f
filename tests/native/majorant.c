/* A certified step never passes a root of a motion whose fourth derivative keeps its bound. */
#include "motion/majorant.h"

#include <stdbool.h>

#include "check.h"

/* Clearance of a motion with constant fourth derivative `snap`. */
static double clearance_after(const vi_approach *p, double snap, double s)
{
    return p->clearance - s * (p->velocity + s * (p->acceleration / 2.0 + s * (p->jerk / 6.0 + s * snap / 24.0)));
}

static vi_approach random_approach(uint64_t *seed)
{
    vi_approach p = {uniform(seed, 0.0, 2.0), uniform(seed, -2.0, 2.0), uniform(seed, -2.0, 2.0),
                     uniform(seed, -2.0, 2.0), uniform(seed, 0.0, 5.0)};
    switch (choice(seed, 6)) {
    case 0: p.clearance = 0.0, p.velocity = -fabs(p.velocity); break;                     /* after an impact */
    case 1: p.clearance = p.velocity = 0.0, p.acceleration = -fabs(p.acceleration); break; /* a touch */
    case 2: p.clearance = p.velocity = p.acceleration = 0.0, p.jerk = -fabs(p.jerk); break; /* a release */
    case 3: p.clearance *= 1e-12; break;
    default: break;
    }
    if (choice(seed, 10) == 0) {
        p.bound = 0.0;
    }
    return p;
}

int main(void)
{
    uint64_t seed = 1;
    int stalled = 0;
    for (int n = 0; n < 300000; ++n) {
        const vi_approach p = random_approach(&seed);
        const double horizon = uniform(&seed, 0.0, 3.0);
        const double s = vi_certified_step(&p, horizon);
        CHECK(s >= 0.0 && s <= horizon, "step %g, horizon %g", s, horizon);
        for (int i = 0; i <= 20; ++i) {
            const double part = s * i / 20.0, noise = 1e-15 * (p.clearance + 10.0 * part);
            for (int snap = -1; snap <= 1; ++snap) {
                const double left = clearance_after(&p, snap * p.bound, part);
                CHECK(left >= -noise, "d=%g v=%g a=%g j=%g B=%g: %g left after %g of %g", p.clearance, p.velocity,
                      p.acceleration, p.jerk, p.bound, left, part, s);
            }
        }
        /* steps are > 0 except at a contact */
        const bool leaves = p.velocity < 0.0 || (p.velocity == 0.0 && p.acceleration < 0.0)
                            || (p.velocity == 0.0 && p.acceleration == 0.0 && p.jerk < 0.0);
        stalled += s == 0.0 && horizon > 0.0 && (p.clearance > 0.0 || leaves);
    }
    CHECK(stalled == 0, "%d steps stalled", stalled);
    return 0;
}
