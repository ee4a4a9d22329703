//! Queries.

use num::QuerySetId;
use trace::command::*;

use super::args::Args;
use super::fault::{Fault, Outcome, unsupported};
use super::machine::Vulkan;
use super::objects::{Handle, PoolKind, known};
use super::pass::Open;
use super::submission::Encoder;

/// The statistics that the card counts: `VkQueryPipelineStatisticFlags`, in the order of the native ones.
const STATISTICS: [u32; 5] = [1 << 2, 1 << 5, 1 << 6, 1 << 7, 1 << 10];

/// The native statistics of Vulkan's; none if the card does not count one of them.
fn statistics(flags: u32) -> Option<u8> {
    let known: u32 = STATISTICS.iter().sum();
    let bit = |(at, flag): (usize, &u32)| u8::from(flags & flag != 0) << at;
    (flags != 0 && flags & !known == 0).then(|| STATISTICS.iter().enumerate().map(bit).sum())
}

impl Vulkan {
    /// The native set of a query pool; none if the card does not count that.
    fn query_set(&mut self, handle: Handle) -> Outcome<Option<(QuerySetId, PoolKind)>> {
        let pool = known(self.objects.query_pools.get_mut(handle), "query pool", handle)?;
        let kind = match pool.kind {
            PoolKind::Occlusion => QueryKind::Occlusion,
            PoolKind::Timestamp => QueryKind::Timestamp,
            PoolKind::Statistics(flags) => match statistics(flags) {
                Some(bits) => QueryKind::PipelineStatistics(bits),
                None => return Ok(None),
            },
            PoolKind::Other => return Ok(None),
        };
        if trace::check::rules::query_set(kind, pool.count).is_err() {
            return Ok(None);
        }
        let card = &mut self.card;
        let count = pool.count;
        Ok(Some((*pool.native.get_or_insert_with(|| card.create_query_set(kind, count)), pool.kind)))
    }

    /// Ends a query pool.
    pub fn destroy_query_pool(&mut self, handle: Handle) {
        if let Some(set) = self.objects.query_pools.remove(handle).and_then(|pool| pool.native) {
            self.card.push(Command::Destroy(Object::QuerySet(set)));
        }
    }

    /// Runs a command about queries. Answers whether it is one.
    ///
    /// The program gets the results that the recording has, so a query counts only for commands that copy its result.
    pub fn query_command(&mut self, name: &str, call: Args<'_>, encoder: &mut Encoder) -> Outcome<bool> {
        match name {
            "vkCmdResetQueryPool" => {}
            "vkCmdWriteTimestamp" | "vkCmdWriteTimestamp2" => {
                let (pool, index) = (call.u64("queryPool")?, call.u32("query")?);
                let Some((set, PoolKind::Timestamp)) = self.query_set(pool)? else { return Ok(true) };
                let stamp = Command::WriteTimestamp { set, index };
                match &mut encoder.open {
                    Open::Render(pass) => pass.commands.push(stamp),
                    Open::Compute(..) => {
                        self.close(&mut encoder.open);
                        self.card.push(stamp);
                    }
                    Open::Nothing => self.card.push(stamp),
                }
            }
            "vkCmdBeginQuery" | "vkCmdBeginQueryIndexed" => {
                let (pool, index) = (call.u64("queryPool")?, call.u32("query")?);
                let Some((set, kind)) = self.query_set(pool)? else { return Ok(true) };
                let mut pass = match std::mem::take(&mut encoder.open) {
                    Open::Render(pass) => pass,
                    other => {
                        encoder.open = other;
                        known(self.objects.query_pools.get_mut(pool), "query pool", pool)?.uncounted = true;
                        return Ok(true);
                    }
                };
                match kind {
                    PoolKind::Occlusion if encoder.occlusion.is_none() => {
                        if pass.occlusion.is_some_and(|other| other != set) {
                            self.reopen(&mut pass);
                        }
                        pass.occlusion = Some(set);
                        pass.commands.push(Command::BeginOcclusionQuery { index });
                        encoder.occlusion = Some((pool, index));
                    }
                    PoolKind::Statistics(_) if encoder.statistics.is_none() => {
                        pass.commands.push(Command::BeginStatisticsQuery { set, index });
                        encoder.statistics = Some((pool, index));
                    }
                    _ => {}
                }
                encoder.open = Open::Render(pass);
            }
            "vkCmdEndQuery" | "vkCmdEndQueryIndexed" => {
                let query = Some((call.u64("queryPool")?, call.u32("query")?));
                let Open::Render(pass) = &mut encoder.open else { return Ok(true) };
                if encoder.occlusion == query {
                    pass.commands.push(Command::EndOcclusionQuery);
                    encoder.occlusion = None;
                } else if encoder.statistics == query {
                    pass.commands.push(Command::EndStatisticsQuery);
                    encoder.statistics = None;
                }
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Copies results of queries into a buffer.
    pub fn copy_results(&mut self, call: Args<'_>) -> Outcome {
        let pool = call.u64("queryPool")?;
        let Some((set, kind)) = self.query_set(pool)? else {
            return unsupported("results of queries that the card does not count");
        };
        if known(self.objects.query_pools.get(pool), "query pool", pool)?.uncounted {
            return unsupported("results of queries that begin outside of a pass");
        }
        let (first, count) = (call.u32("firstQuery")?, call.u32("queryCount")?);
        let results = match kind {
            PoolKind::Statistics(flags) => flags.count_ones(),
            _ => 1,
        };
        let pool_count = known(self.objects.query_pools.get(pool), "query pool", pool)?.count;
        if first.checked_add(count).is_none_or(|end| end > pool_count) {
            return Err(Fault::Damaged(format!("queries {first} + {count} of pool {pool}, which has {pool_count}")));
        }
        let (flags, stride) = (call.u32("flags")?, call.u64("stride")?);
        // With a word behind them that says whether the results are there.
        let each = u64::from(results + (flags >> 2 & 1)) * if flags & 1 != 0 { 8 } else { 4 };
        if count == 0 {
            return Ok(());
        }
        let bytes = stride.saturating_mul(u64::from(count - 1)).saturating_add(each);
        let (buffer, at) = (call.u64("dstBuffer")?, call.u64("dstOffset")?);
        if count > 1 && (stride % 4 != 0 || stride < each) || at % 4 != 0 {
            return Err(Fault::Damaged(format!("results of {each} bytes, {stride} apart from byte {at} on")));
        }
        let (to, offset, _) = self.range(buffer, at, Some(bytes))?;
        if flags & 5 == 1 && (stride == each || count == 1) {
            self.card.resolve_queries(set, first, count, to, offset);
            return Ok(());
        }
        self.write_results((set, first, count), results, flags, stride, (to, offset, bytes))
    }
}
