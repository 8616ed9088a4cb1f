#include "body/record.h"

#include <math.h>
#include <string.h>

void vi_record_take(vi_record *record)
{
    if (record->taken > 0) {
        const int64_t left = record->count > record->taken ? record->count - record->taken : 0;
        memmove(record->rows, record->rows + (record->count - left) * VI_RECORD_WIDTH,
                (size_t)left * VI_RECORD_WIDTH * sizeof(double));
        record->count = left;
        record->reported = 0;
    }
    record->taken = 0;
}

bool vi_record_begin_step(vi_record *record, double displacement)
{
    const int32_t was_recording = record->recording;
    record->recording = record->impacts || record->periods;
    if (record->extrema && !record->open) {
        record->displacement_max = record->displacement_min = displacement;
    }
    record->open = record->extrema;
    if (!record->periods) {
        record->period_open = 0;
    }
    return record->recording && !was_recording;
}

void vi_record_switched(vi_record *record)
{
    record->recording = record->recording && (record->impacts || record->periods);
}

bool vi_record_full(const vi_record *record)
{
    return record->count > VI_RECORD_CAPACITY - VI_RECORD_RESERVE - record->further;
}

bool vi_record_ends_step(vi_record *record)
{
    const bool ends = vi_record_full(record) && !record->reported;
    record->reported |= ends;
    return ends;
}

static void append(vi_record *record, const double row[VI_RECORD_WIDTH])
{
    if (record->count >= VI_RECORD_CAPACITY) {
        record->dropped += 1;
        return;
    }
    memcpy(record->rows + record->count * VI_RECORD_WIDTH, row, VI_RECORD_WIDTH * sizeof(double));
    record->count += 1;
}

void vi_record_contact(vi_record *record, double time, double phase, double velocity, double impulse, int contact,
                       double restitution, double duration, double peak_force)
{
    if (record->impacts) {
        const double row[] = {VI_ROW_IMPACT, time, phase, velocity, impulse, (double)contact, restitution, duration};
        const double peak[] = {VI_ROW_PEAK, time, (double)contact, peak_force, 0.0, 0.0, 0.0, 0.0};
        append(record, row);
        append(record, peak);
    }
}

void vi_record_impact(vi_record *record, double time, double phase, double velocity, double impulse, int contact,
                      double restitution)
{
    record->period_impacts += 1;
    if (record->impacts) {
        const double row[] = {VI_ROW_IMPACT, time, phase, velocity, impulse, (double)contact, restitution, 0.0};
        append(record, row);
    }
}

void vi_record_stick(vi_record *record, double start, double end, int contact, double tail_impulse)
{
    if (record->impacts) {
        const double row[] = {VI_ROW_STICK, start, end, (double)contact, tail_impulse, 0.0, 0.0, 0.0};
        append(record, row);
    }
}

void vi_record_extend(vi_record *record, double displacement)
{
    if (displacement > record->displacement_max) {
        record->displacement_max = displacement;
    }
    if (displacement < record->displacement_min) {
        record->displacement_min = displacement;
    }
}

void vi_record_point_begin(vi_record *record, int point, double displacement)
{
    if (record->extrema && !record->open) {
        record->point[point].displacement_max = record->point[point].displacement_min = displacement;
    }
}

void vi_record_point_extend(vi_record *record, int point, double displacement)
{
    vi_record_point *p = &record->point[point];
    p->displacement_max = displacement > p->displacement_max ? displacement : p->displacement_max;
    p->displacement_min = displacement < p->displacement_min ? displacement : p->displacement_min;
}

void vi_record_point_period(vi_record *record, int point, double displacement, double velocity)
{
    vi_record_point *p = &record->point[point];
    if (record->period_open) {
        const double high = record->extrema ? p->displacement_max : NAN;
        const double low = record->extrema ? p->displacement_min : NAN;
        const double row[] = {VI_ROW_FURTHER, record->period_start, (double)(point + 1), high, low,
                              p->strobe_displacement, p->strobe_velocity, 0.0};
        append(record, row);
    }
    *p = (vi_record_point){displacement, displacement, displacement, velocity};
}

void vi_record_period(vi_record *record, double time, double displacement, double velocity)
{
    if (record->period_open) {
        const double high = record->extrema ? record->displacement_max : NAN;
        const double low = record->extrema ? record->displacement_min : NAN;
        const double row[] = {VI_ROW_PERIOD, record->period_start, high, low,
                              record->strobe_displacement, record->strobe_velocity,
                              (double)record->period_impacts, 0.0};
        append(record, row);
    }
    record->period_open = 1;
    record->period_start = time;
    record->strobe_displacement = displacement;
    record->strobe_velocity = velocity;
    record->period_impacts = 0;
    if (record->extrema) {
        record->displacement_max = record->displacement_min = displacement;
    }
}

size_t vi_record_unused(const vi_record *record)
{
    return (size_t)(VI_RECORD_CAPACITY - record->count) * VI_RECORD_WIDTH * sizeof(double);
}
