#include "body/signal_check.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>

/* Largest phase of a chirp, rad: 2^53. The phase is then right to 1e-16 rad. */
static const double MOST_TURNED = 9007199254740992.0;
/* Upper end of the band of a random signal, rad/s: third powers of its interval are normal numbers. */
static const double SLOWEST = 1e-100, FASTEST = 1e100;

typedef struct {
    char text[64];
} member_name;

static member_name name_of(const char *signal, const char *member)
{
    member_name name;
    (void)snprintf(name.text, sizeof name.text, "%s.%s", signal, member);
    return name;
}

static void check_duration(char *message, const char *name, const vi_signal *s)
{
    vi_check_positive(message, name_of(name, "duration").text, s->duration);
}

static void check_chirp(char *message, const char *name, const vi_signal *s)
{
    const vi_check check = s->kind == VI_CHIRP_LOGARITHMIC ? vi_check_positive : vi_check_not_negative;
    check(message, name_of(name, "angular_frequency").text, s->angular_frequency);
    check(message, name_of(name, "end_angular_frequency").text, s->end_angular_frequency);
    vi_check_finite(message, name_of(name, "phase").text, s->phase);
    check_duration(message, name, s);
    const double turned = s->duration * fmax(s->angular_frequency, s->end_angular_frequency);
    if (message[0] == '\0' && !(turned + fabs(s->phase) <= MOST_TURNED)) {
        vi_complain(message, "%s.duration: expected a phase of at most 2^53 rad, got %.17g", name, turned);
    }
}

static void check_trapezoid(char *message, const char *name, const vi_signal *s)
{
    check_duration(message, name, s);
    if (!(s->rise >= 0.0 && s->rise <= 0.5 * s->duration)) {
        vi_complain(message, "%s.rise: expected 0 to half of the duration, %.17g s, got %.17g", name,
                    0.5 * s->duration, s->rise);
    }
}

/* Complain of the first number of a table that breaks a rule. least: of the values. */
static void check_table(char *message, const char *name, const char *places, double least, const vi_table *table)
{
    if (table->count < 2 || table->count > VI_TABLE_ROOM) {
        vi_complain(message, "%s.table_count: expected 2 to %d %s, got %d", name, VI_TABLE_ROOM, places, table->count);
        return;
    }
    for (int k = 0; k < table->count; ++k) {
        const double at = table->time[k], value = table->value[k], before = k > 0 ? table->time[k - 1] : -HUGE_VAL;
        const double slope = k > 0 ? (value - table->value[k - 1]) / (at - before) : 0.0;
        if (!isfinite(at) || !(at > before)) {
            vi_complain(message, "%s.table: expected %s that ascend, got %.17g as number %d", name, places, at, k + 1);
            return;
        }
        if (!isfinite(value) || !(value >= least) || !isfinite(slope)) {
            vi_complain(message, "%s.table: expected finite values%s, got %.17g as number %d", name,
                        least == 0.0 ? " >= 0" : "", value, k + 1);
            return;
        }
    }
}

static void check_band(char *message, const char *name, const vi_density *density)
{
    const double low = density->low, high = density->high;
    if (!(high >= SLOWEST && high <= FASTEST)) {
        vi_complain(message, "%s.end_angular_frequency: expected %g to %g rad/s, got %.17g", name, SLOWEST, FASTEST,
                    high);
    } else if (!(low >= 0.0 && high - low >= VI_NARROWEST_BAND * high)) {
        vi_complain(message, "%s.angular_frequency: expected 0 to %.17g rad/s, below the upper end of the band by 1/256,"
                             " got %.17g", name, (1.0 - VI_NARROWEST_BAND) * high, low);
    }
}

static void check_random(char *message, const char *name, const vi_signal *s)
{
    const vi_density density = vi_signal_density(s);
    const vi_table *table = &s->table;
    vi_check_not_negative(message, name_of(name, "duration").text, s->duration);
    if (table->count != 0) {
        check_table(message, name, "angular frequencies", 0.0, table);
    }
    if (message[0] == '\0') {
        check_band(message, name, &density);
    }
    if (message[0] != '\0' || table->count == 0) {
        return;
    }
    const double first = table->time[0], last = table->time[table->count - 1];
    if (density.low < first || density.high > last) {
        vi_complain(message, "%s.table: expected a density over all the band, %.17g to %.17g rad/s, got one from %.17g to"
                             " %.17g", name, density.low, density.high, first, last);
    } else if (!(vi_density_variance(&density) > 0.0) || !isfinite(vi_density_variance(&density))) {
        vi_complain(message, "%s.table: expected a density with a finite variance > 0, got %.17g", name,
                    vi_density_variance(&density));
    }
}

void vi_check_signal(char message[VI_MESSAGE_LENGTH], const char *name, const vi_signal *s)
{
    if (s->kind != VI_NO_SIGNAL) {
        vi_check_finite(message, name_of(name, "start").text, s->start);
    }
    switch (s->kind) {
    case VI_NO_SIGNAL:
        break;
    case VI_CHIRP_LINEAR:
    case VI_CHIRP_LOGARITHMIC:
        check_chirp(message, name, s);
        break;
    case VI_HALF_SINE:
    case VI_TRIANGLE:
        check_duration(message, name, s);
        break;
    case VI_TRAPEZOID:
        check_trapezoid(message, name, s);
        break;
    case VI_TABLE_LINEAR:
    case VI_TABLE_CUBIC:
        check_table(message, name, "instants", -HUGE_VAL, &s->table);
        break;
    case VI_RANDOM:
        check_random(message, name, s);
        break;
    default:
        vi_complain(message, "%s.kind: expected 0 to 8, got %d", name, (int)s->kind);
    }
}
