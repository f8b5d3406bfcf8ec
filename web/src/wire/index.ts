export * from "./peer";
export * from "./frame";
export * from "./messages";
